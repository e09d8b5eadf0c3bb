#include "reconstruct/pcl_adapter.h"

#include <pcl/console/print.h>
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>
#include <pcl/surface/poisson.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <fcntl.h>
#include <memory>
#include <new>
#include <unistd.h>

struct tsuya_pcl_tree {
    pcl::KdTreeFLANN<pcl::PointXYZ> tree;
};

namespace {

/* Runs `body` and turns what it throws into a status. */
template <typename Body> tsuya_status guarded(const char *what, Body body)
{
    try {
        return body();
    } catch (const std::bad_alloc &) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory in %s", what);
    } catch (const std::exception &e) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "%s: %s", what, e.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "%s failed without a reason", what);
    }
}

/* PCL's octree prints straight to stdout and stderr; both lead nowhere while this lives. */
class Silence {
public:
    Silence()
    {
        std::fflush(stdout);
        std::fflush(stderr);
        int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
        for (int fd = 1; fd <= 2 && nowhere >= 0; fd++) {
            kept_[fd - 1] = fcntl(fd, F_DUPFD_CLOEXEC, 3);
            if (kept_[fd - 1] >= 0) {
                dup2(nowhere, fd);
            }
        }
        if (nowhere >= 0) {
            close(nowhere);
        }
    }
    ~Silence()
    {
        std::fflush(stdout);
        std::fflush(stderr);
        for (int fd = 1; fd <= 2; fd++) {
            if (kept_[fd - 1] >= 0) {
                dup2(kept_[fd - 1], fd);
                close(kept_[fd - 1]);
            }
        }
    }
    Silence(const Silence &) = delete;
    Silence &operator=(const Silence &) = delete;

private:
    int kept_[2] = {-1, -1};
};

pcl::PointCloud<pcl::PointNormal>::Ptr with_normals(const tsuya_mesh *cloud)
{
    pcl::PointCloud<pcl::PointNormal>::Ptr points(new pcl::PointCloud<pcl::PointNormal>);
    points->resize(cloud->vertex_count);
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        pcl::PointNormal &p = (*points)[v];
        const float *x = cloud->position + 3 * v, *n = cloud->normal + 3 * v;
        p.x = x[0], p.y = x[1], p.z = x[2];
        p.normal_x = n[0], p.normal_y = n[1], p.normal_z = n[2];
    }
    return points;
}

tsuya_status to_mesh(tsuya_mesh *mesh, const pcl::PointCloud<pcl::PointNormal> &points,
                     const std::vector<pcl::Vertices> &polygons)
{
    TSUYA_TRY(tsuya_mesh_create(mesh, points.size(), polygons.size(), 0));
    for (size_t v = 0; v < points.size(); v++) {
        mesh->position[3 * v] = points[v].x;
        mesh->position[3 * v + 1] = points[v].y;
        mesh->position[3 * v + 2] = points[v].z;
    }
    for (size_t t = 0; t < polygons.size(); t++) {
        bool triangle = polygons[t].vertices.size() == 3;
        for (size_t k = 0; k < 3 && triangle; k++) {
            mesh->triangle[3 * t + k] = static_cast<uint32_t>(polygons[t].vertices[k]);
            triangle = mesh->triangle[3 * t + k] < points.size();
        }
        if (!triangle) {
            tsuya_mesh_free(mesh);
            return tsuya_fail(TSUYA_ERROR_NUMERIC, "PCL's Poisson surface has a face that is no triangle of its vertices");
        }
    }
    return TSUYA_OK;
}

} // namespace

tsuya_status tsuya_pcl_tree_create(tsuya_pcl_tree **tree, const float *position, size_t count)
{
    return guarded("the nearest-neighbour tree", [&] {
        pcl::PointCloud<pcl::PointXYZ>::Ptr points(new pcl::PointCloud<pcl::PointXYZ>);
        points->resize(count);
        for (size_t v = 0; v < count; v++) {
            (*points)[v] = pcl::PointXYZ(position[3 * v], position[3 * v + 1], position[3 * v + 2]);
        }
        std::unique_ptr<tsuya_pcl_tree> made(new tsuya_pcl_tree);
        made->tree.setInputCloud(points);
        *tree = made.release();
        return TSUYA_OK;
    });
}

void tsuya_pcl_tree_free(tsuya_pcl_tree *tree) { delete tree; }

tsuya_status tsuya_pcl_nearest(uint32_t *index, float *distance2, const tsuya_pcl_tree *tree, const float *query,
                               size_t query_count, int k, int threads)
{
    const size_t block = 1024, blocks = (query_count + block - 1) / block, neighbours = static_cast<size_t>(k);
    std::atomic<bool> failed(false);
#pragma omp parallel for num_threads(threads)
    for (size_t b = 0; b < blocks; b++) {
        /* guarded here, since no exception may leave an iteration */
        tsuya_status status = guarded("the nearest-neighbour search", [&] {
            pcl::Indices found(neighbours);
            std::vector<float> squared(neighbours);
            for (size_t q = b * block; q < std::min(query_count, (b + 1) * block); q++) {
                const pcl::PointXYZ point(query[3 * q], query[3 * q + 1], query[3 * q + 2]);
                if (tree->tree.nearestKSearch(point, k, found, squared) != k) {
                    return TSUYA_ERROR_NUMERIC;
                }
                for (size_t n = 0; n < neighbours; n++) {
                    index[q * neighbours + n] = static_cast<uint32_t>(found[n]);
                    distance2[q * neighbours + n] = squared[n];
                }
            }
            return TSUYA_OK;
        });
        if (status != TSUYA_OK) {
            failed = true;
        }
    }
    return failed ? tsuya_fail(TSUYA_ERROR_NUMERIC, "the search for %d nearest neighbours failed", k) : TSUYA_OK;
}

tsuya_status tsuya_pcl_poisson(tsuya_mesh *mesh, const tsuya_mesh *cloud, int depth, float point_weight)
{
    return guarded("PCL's Poisson surface", [&] {
        pcl::PointCloud<pcl::PointNormal> points;
        std::vector<pcl::Vertices> polygons;
        {
            Silence silence;
            pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
            pcl::Poisson<pcl::PointNormal> poisson;
            poisson.setThreads(1);
            poisson.setDepth(depth);
            poisson.setPointWeight(point_weight);
            poisson.setInputCloud(with_normals(cloud));
            poisson.performReconstruction(points, polygons);
        }
        return to_mesh(mesh, points, polygons);
    });
}
