/* Metric scale and frame of a reconstruction, from points whose places are known: corners of AprilTags on rigid plates, or
 * pairs of points a measured distance apart.
 *
 * Every point is triangulated from all registered photographs that see it (best pair first, then Gauss–Newton on the
 * reprojection error of those that agree, each weighted by its own sigma and by what the cameras themselves leave).  A plate's
 * corners then fit a similarity, weighted by the triangulation's covariances:
 *
 *     scale · rotation_k · X + translation_k = centre + (1 + growth_k) (corner − centre)
 *
 * with one scale for all plates, and a growth of each plate's tags about their centres (ink, exposure and a tag edge that was
 * measured badly move all edges alike; the distances between tags do not care).  Corners beyond four robust sigmas are left
 * out and counted.  The world becomes the frame of the first plate that is seen: metres, z out of the mat.
 *
 * The cameras are kept as they are: the similarity moves and scales the model as a whole. */
#ifndef TSUYA_RECONSTRUCT_SCALE_H
#define TSUYA_RECONSTRUCT_SCALE_H

#include "core/camera.h"
#include "core/json.h"

/* A point in a photograph.  Point 4t + c is corner c of tag t; distances have points of their own. */
typedef struct tsuya_scale_sighting {
    const char *photo;
    int point;
    tsuya_vec2 pixel;
    double sigma_px;
} tsuya_scale_sighting;

typedef struct tsuya_scale_tag {
    int id, plate;
    tsuya_vec3 corner_m[4]; /* in the plate's frame */
} tsuya_scale_tag;

typedef struct tsuya_scale_distance {
    int a, b; /* points */
    double distance_m;
} tsuya_scale_distance;

/* Borrowed.  Either tags or distances. */
typedef struct tsuya_scale_input {
    const char *source;                   /* the board's file, for messages */
    const tsuya_scale_sighting *sighting; /* by point */
    int sighting_count;
    const tsuya_scale_tag *tag;           /* plate by plate */
    int tag_count;
    const char *const *plate;             /* names */
    int plate_count;
    const tsuya_scale_distance *distance;
    int distance_count;
    double edge_bias;                     /* blur widths that the sightings were moved by, already; for the record */
} tsuya_scale_input;

enum { TSUYA_SCALE_PLATES = 32 };

typedef struct tsuya_scale_plate {
    int tags, corners, outliers;
    double growth;                  /* of the tags' edges, a share; 0 where one tag alone is seen */
    tsuya_pose plate_from_reference; /* where two plates stand to each other */
    double rms_m;                   /* of its corners */
} tsuya_scale_plate;

typedef struct tsuya_scale_info {
    double scale_m_per_unit;
    double rms_m;          /* tags (or distances) left out in turn against what the others say; NaN with one alone */
    double sigma_rel;      /* one sigma of the scale, a share */
    double spacing_rms_m;  /* of the distances between tags' centres on one plate; NaN for distances */
    double reprojection_px; /* of the points used, per coordinate */
    int photos, points, points_lost; /* that took part; points with sightings that could not be triangulated */
    int tags_used, tags_seen, outliers;
    int reference;         /* plate that gives the frame; −1: the frame stays */
    tsuya_scale_plate plate[TSUYA_SCALE_PLATES];
} tsuya_scale_info;

/* Fails with one line where the points do not determine the scale: none in a registered photograph, in one alone, plates
 * whose tags do not lie as the file says. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_scale_find(tsuya_similarity *metric_from_model, tsuya_scale_info *info, const tsuya_sparse_model *model,
                                                         const tsuya_scale_input *input);
TSUYA_API void tsuya_scale_info_to_json(tsuya_json *object, const tsuya_scale_info *info, const tsuya_scale_input *input);

#endif
