#include "app/bench_picture.h"

#include "core/file.h"
#include "core/memory.h"
#include "core/process.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

tsuya_status tsuya_bench_points_add(tsuya_bench_points *points, const char *stage, const char *line)
{
    tsuya_bench_point p = {.stage = stage};
    int used = 0;
    int read = sscanf(line, "%63[^,],%63[^,],%lf,%31[^,],%lf,%31[^,]%n", p.part, p.method, &p.error, p.error_unit, &p.cost, p.cost_unit, &used);
    if (read != 6 || line[used] != '\0' || !isfinite(p.error) || !isfinite(p.cost)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "bench %s: \"%s\"; expected part,method,error,unit,cost,unit", stage, line);
    }
    if (points->count == points->room) {
        size_t room = points->room ? 2 * points->room : 64;
        tsuya_bench_point *grown = tsuya_realloc(points->point, room, sizeof *grown);
        if (!grown) {
            return TSUYA_ERROR_MEMORY;
        }
        points->point = grown;
        points->room = room;
    }
    points->point[points->count++] = p;
    return TSUYA_OK;
}

void tsuya_bench_points_free(tsuya_bench_points *points)
{
    tsuya_free(points->point);
    *points = (tsuya_bench_points){0};
}

tsuya_status tsuya_bench_points_save(const tsuya_bench_points *points, const char *folder)
{
    tsuya_file_writer writer;
    char *path = tsuya_path_join(folder, "bench.csv");
    tsuya_status status = path ? tsuya_file_begin(&writer, path) : TSUYA_ERROR_MEMORY;
    tsuya_free(path);
    TSUYA_TRY(status);
    fprintf(writer.stream, "stage,part,method,error,error_unit,cost,cost_unit\n");
    for (size_t k = 0; k < points->count; k++) {
        const tsuya_bench_point *p = &points->point[k];
        fprintf(writer.stream, "%s,%s,%s,%.6g,%s,%.6g,%s\n", p->stage, p->part, p->method, p->error, p->error_unit, p->cost, p->cost_unit);
    }
    return tsuya_file_commit(&writer);
}

/* The first point of its part within the stage: where a panel begins. */
static bool opens_panel(const tsuya_bench_points *points, size_t index, const char *stage)
{
    const tsuya_bench_point *p = &points->point[index];
    if (strcmp(p->stage, stage) != 0) {
        return false;
    }
    for (size_t k = 0; k < index; k++) {
        if (strcmp(points->point[k].stage, stage) == 0 && strcmp(points->point[k].part, p->part) == 0) {
            return false;
        }
    }
    return true;
}

static bool in_panel(const tsuya_bench_point *p, const tsuya_bench_point *first)
{
    return strcmp(p->stage, first->stage) == 0 && strcmp(p->part, first->part) == 0;
}

/* Room for the labels beside the points. */
static void write_axis(FILE *file, char axis, double low, double high)
{
    if (low > 0.0) {
        fprintf(file, "set logscale %c\nset %crange [%g:%g]\n", axis, axis, low / (axis == 'x' ? 1.5 : 2.0), high * (axis == 'x' ? 8.0 : 2.0));
    } else {
        double span = high > low ? high - low : 1.0;
        fprintf(file, "unset logscale %c\nset %crange [%g:%g]\n", axis, axis, low - 0.1 * span, high + (axis == 'x' ? 0.6 : 0.2) * span);
    }
}

static void write_panel(FILE *file, const tsuya_bench_points *points, const tsuya_bench_point *first)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (size_t k = 0; k < points->count; k++) {
        const tsuya_bench_point *p = &points->point[k];
        const double value[2] = {p->cost, p->error};
        for (int i = 0; i < 2 && in_panel(p, first); i++) {
            low[i] = fmin(low[i], value[i]);
            high[i] = fmax(high[i], value[i]);
        }
    }
    write_axis(file, 'x', low[0], high[0]);
    write_axis(file, 'y', low[1], high[1]);
    fprintf(file, "set title \"%s\"\nset xlabel \"%s\"\nset ylabel \"error, %s\"\n", first->part, first->cost_unit, first->error_unit);
    fprintf(file, "plot '-' using 1:2:3 with labels left offset 1,0 point pointtype 7 pointsize 0.6 notitle\n");
    for (size_t k = 0; k < points->count; k++) {
        const tsuya_bench_point *p = &points->point[k];
        if (in_panel(p, first)) {
            fprintf(file, "%.6g %.6g \"%s\"\n", p->cost, p->error, p->method);
        }
    }
    fprintf(file, "e\n");
}

static tsuya_status write_script(const char *path, const char *picture, const tsuya_bench_points *points, const char *stage)
{
    tsuya_file_writer writer;
    int panels = 0;
    for (size_t k = 0; k < points->count; k++) {
        panels += opens_panel(points, k, stage);
    }
    int columns = panels > 1 ? 2 : 1, rows = (panels + columns - 1) / columns;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fprintf(writer.stream, "set terminal svg size %d,%d font 'sans,11' noenhanced\nset output '%s'\nset grid\nset multiplot layout %d,%d\n",
            520 * columns, 380 * rows, picture, rows, columns);
    for (size_t k = 0; k < points->count; k++) {
        if (opens_panel(points, k, stage)) {
            write_panel(writer.stream, points, &points->point[k]);
        }
    }
    fprintf(writer.stream, "unset multiplot\n");
    return tsuya_file_commit(&writer);
}

tsuya_status tsuya_bench_picture(const tsuya_bench_points *points, const char *stage, const char *folder)
{
    char name[64], temporary_name[80], script_name[64];
    snprintf(name, sizeof name, "%s.svg", stage);
    snprintf(temporary_name, sizeof temporary_name, ".%s.svg.part", stage);
    snprintf(script_name, sizeof script_name, ".%s.gnuplot", stage);
    char *picture = tsuya_path_join(folder, name), *temporary = tsuya_path_join(folder, temporary_name), *script = tsuya_path_join(folder, script_name);
    tsuya_status status = picture && temporary && script ? write_script(script, temporary_name, points, stage) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        const char *argv[] = {"gnuplot", script_name, NULL};
        tsuya_process_options options = {.working_folder = folder};
        status = tsuya_process_run(NULL, argv, &options);
        unlink(script);
    }
    if (status == TSUYA_OK) {
        status = tsuya_file_rename_into_place(temporary, picture);
    }
    tsuya_free(picture);
    tsuya_free(temporary);
    tsuya_free(script);
    return status;
}
