#include "app/brdf_plot.h"
#include "app/gnuplot.h"

#include "core/memory.h"

#include <math.h>

enum { RINGS = 61, SPOKES = 240, STEPS = 241 };
static const char *const color[TSUYA_PLOT_AZIMUTHS] = {"#0060a8", "#d1480a", "#00805c", "#b0508c", "#c98a00", "#3f9fd8", "#6d4bb0", "#404040"};

/* What the bench's camera would see of the material: f·cosθi, NaN where lamp or camera is under the sample. */
static double intensity(const tsuya_brdf_picture *p, const tsuya_plot_data *d, double azimuth_deg, double tilt_deg)
{
    double value[TSUYA_MATERIAL_MAX_CHANNELS];
    tsuya_vec3 wi = tsuya_goniometer_direction(p->bench.light_deg[0], p->bench.light_deg[1], azimuth_deg, tilt_deg);
    tsuya_vec3 wo = tsuya_goniometer_direction(p->bench.view_deg[0], p->bench.view_deg[1], azimuth_deg, tilt_deg);
    if (wi.z < 0.02 || wo.z < 0.02) {
        return NAN;
    }
    tsuya_material_eval(p->material, NULL, wi, wo, value);
    return (p->scale * value[d->material_channel] + p->body / M_PI) * wi.z;
}

static bool has_lines(const tsuya_plot_data *d) { return d->material_channel >= 0; }

static void write_number(FILE *f, double x)
{
    if (isfinite(x)) {
        fprintf(f, "%.9g", x);
    } else {
        fputs("NaN", f);
    }
}

/* $lineK (tilt, intensity) and $pointK of every azimuth. */
static void write_curves(const tsuya_gnuplot *g, const tsuya_brdf_picture *p, const tsuya_plot_data *d)
{
    for (int k = 0; k < d->azimuths; ++k) {
        fprintf(g->script, "$line%d << EOD\n", k);
        for (int i = 0; i < STEPS && has_lines(d); ++i) {
            double t = d->tilt_deg[0] + (d->tilt_deg[1] - d->tilt_deg[0]) * i / (STEPS - 1);
            fprintf(g->script, "%.6g ", t);
            write_number(g->script, intensity(p, d, d->azimuth_deg[k], t));
            fputc('\n', g->script);
        }
        fprintf(g->script, "0 NaN\nEOD\n$point%d << EOD\n", k);
        for (int i = 0; i < d->count; ++i) {
            if (fabs(d->point[i].azimuth_deg - d->azimuth_deg[k]) < 0.5) {
                fprintf(g->script, "%.6g %.9g\n", d->point[i].tilt_deg, d->point[i].intensity);
            }
        }
        fputs("0 NaN\nEOD\n", g->script);
    }
}

static void azimuth_name(char text[48], double a)
{
    const char *name = fabs(a) < 0.5 ? "weft" : fabs(a - 90.0) < 0.5 ? "warp" : "";
    snprintf(text, 48, "%s%s%.4g°", name, name[0] ? ", " : "", a);
}

static void write_title(const tsuya_gnuplot *g, const tsuya_brdf_picture *p, const tsuya_plot_data *d)
{
    char text[256];
    snprintf(text, sizeof text, "%.120s   %s   lamp %.3g°, camera %.3g°", p->title ? p->title : "", d->channel, p->bench.light_deg[0],
             p->bench.view_deg[0]);
    tsuya_gnuplot_text(g, text);
}

static void write_curve_plot(const tsuya_gnuplot *g, const tsuya_plot_data *d, bool lines, bool points)
{
    FILE *f = g->script;
    const char *gap = "plot ";
    for (int k = 0; k < d->azimuths; ++k) {
        char name[48];
        azimuth_name(name, d->azimuth_deg[k]);
        if (lines) {
            fprintf(f, "%s$line%d with lines lw 2 lc rgb '%s' title '%s'", gap, k, color[k], name);
            gap = ", ";
        }
        if (points) {
            fprintf(f, "%s$point%d with %s pt 7 ps 0.6 lc rgb '%s' %s%s%s", gap, k, lines ? "points" : "linespoints", color[k],
                    lines ? "notitle" : "title '", lines ? "" : name, lines ? "" : "'");
            gap = ", ";
        }
    }
    fputs("\n", f);
}

static void curve_axes(const tsuya_gnuplot *g, const tsuya_plot_data *d)
{
    fprintf(g->script, "set xlabel 'tilt of the stage, degrees'\nset xtics 15\nset xrange [%g:%g]\n"
                       "set yrange [0:*]\nset key outside top center horizontal\nset ylabel 'reflected intensity f cosθi, 1/sr'\n",
            d->tilt_deg[0], d->tilt_deg[1]);
}

tsuya_status tsuya_plot_curves(const char *path, const tsuya_brdf_picture *p, const tsuya_plot_data *d)
{
    tsuya_gnuplot g;
    TSUYA_TRY(tsuya_gnuplot_begin(&g, path, 900, 600));
    write_curves(&g, p, d);
    fputs("set title ", g.script);
    write_title(&g, p, d);
    fputc('\n', g.script);
    curve_axes(&g, d);
    write_curve_plot(&g, d, has_lines(d), d->count > 0);
    return tsuya_gnuplot_end(&g);
}

tsuya_status tsuya_plot_pair(const char *path, const tsuya_brdf_picture *p, const tsuya_plot_data *d)
{
    tsuya_gnuplot g;
    double top = 0.0;
    for (int k = 0; k < d->count; ++k) {
        top = fmax(top, d->point[k].intensity);
    }
    for (int k = 0; k < d->azimuths * STEPS && has_lines(d); ++k) {
        double i = intensity(p, d, d->azimuth_deg[k / STEPS], d->tilt_deg[0] + (d->tilt_deg[1] - d->tilt_deg[0]) * (k % STEPS) / (STEPS - 1));
        top = i > top ? i : top;
    }
    TSUYA_TRY(tsuya_gnuplot_begin(&g, path, 1300, 560));
    write_curves(&g, p, d);
    fputs("set multiplot layout 1,2 title ", g.script);
    write_title(&g, p, d);
    fputc('\n', g.script);
    curve_axes(&g, d);
    fprintf(g.script, "set yrange [0:%g]\nset title 'predicted from fibre and weave, times %.3g over a body of %.3g'\n", 1.05 * top, p->scale, p->body);
    write_curve_plot(&g, d, true, false);
    fputs("set title 'measured'\nunset ylabel\n", g.script);
    write_curve_plot(&g, d, false, true);
    fputs("unset multiplot\n", g.script);
    return tsuya_gnuplot_end(&g);
}

/* Every point of the plane is a half vector, which two positions of the stage have, half a turn apart: light and viewer change places, and
 * f·cosθi with them.  One half of the plane by either would leave it torn along the weft, so the mean of both stands there. */
static double half_rest_deg(const tsuya_plot_bench *b)
{
    tsuya_vec3 h = tsuya_vec3_add(tsuya_goniometer_direction(b->light_deg[0], b->light_deg[1], 0, 0),
                                  tsuya_goniometer_direction(b->view_deg[0], b->view_deg[1], 0, 0));
    return tsuya_deg_from_rad(atan2(h.x, h.z));
}

static void write_surface(const tsuya_gnuplot *g, const tsuya_brdf_picture *p, const tsuya_plot_data *d, double rest)
{
    double reach = fmin(fmax(rest - d->tilt_deg[0], d->tilt_deg[1] - rest), 75.0);
    fputs("$surface << EOD\n", g->script);
    for (int u = 0; u <= SPOKES; ++u) {
        double phi = 360.0 * (u % SPOKES) / SPOKES;
        for (int v = 0; v < RINGS; ++v) {
            double theta = reach * v / (RINGS - 1), r = tsuya_rad_from_deg(phi);
            fprintf(g->script, "%.6g %.6g ", theta * cos(r), theta * sin(r));
            write_number(g->script, 0.5 * (intensity(p, d, phi, rest - theta) + intensity(p, d, phi + 180.0, rest + theta)));
            fputc('\n', g->script);
        }
        fputc('\n', g->script);
    }
    fputs("EOD\n", g->script);
}

/* Of light and viewer, over the light's: what makes the mean of both positions of a reading, if f is reciprocal. */
static double mean_cosine(const tsuya_plot_bench *b, const tsuya_plot_point *q)
{
    double light = tsuya_goniometer_direction(b->light_deg[0], b->light_deg[1], q->azimuth_deg, q->tilt_deg).z;
    double view = tsuya_goniometer_direction(b->view_deg[0], b->view_deg[1], q->azimuth_deg, q->tilt_deg).z;
    return 0.5 * (light + view) / light;
}

/* The surface is sorted by depth and would come last: points are drawn over it in a second pass of the same axes. */
static void draw_surface(FILE *f, bool surface, bool points)
{
    if (!surface) {
        fputs("splot $points with points pt 7 ps 0.6 lc rgb '#c02010' title 'measured'\n", f);
    } else if (!points) {
        fputs("splot $surface with pm3d notitle\n", f);
    } else {
        fputs("set multiplot\nsplot $surface with pm3d notitle, $points with points pt 7 ps 0 lc rgb '#ffffff' notitle\nunset grid\nset border 0\n"
              "splot $surface with dots lc rgb '#ffffffff' notitle, $points with points pt 7 ps 0.5 lc rgb '#d01c0c' title 'measured'\nunset multiplot\n", f);
    }
}

tsuya_status tsuya_plot_surface(const char *path, const tsuya_brdf_picture *p, const tsuya_plot_data *d)
{
    tsuya_gnuplot g;
    double rest = half_rest_deg(&p->bench);
    TSUYA_TRY(tsuya_gnuplot_begin(&g, path, 900, 720));
    if (has_lines(d)) {
        write_surface(&g, p, d, rest);
    }
    fputs("$points << EOD\n", g.script);
    for (int k = 0; k < d->count; ++k) {
        double a = tsuya_rad_from_deg(d->point[k].azimuth_deg), r = rest - d->point[k].tilt_deg;
        fprintf(g.script, "%.6g %.6g %.9g\n", r * cos(a), r * sin(a), d->point[k].intensity * mean_cosine(&p->bench, &d->point[k]));
    }
    fputs("0 0 NaN\nEOD\nset title ", g.script);
    write_title(&g, p, d);
    fputs("\nset xlabel 'towards the weft, degrees' offset 0,-0.5\nset ylabel 'towards the warp, degrees' offset 0,-0.5\nset zlabel 'f (cosθi + cosθo)/2, 1/sr' rotate\n"
          "set xyplane 0\nset view 42,332,1.1,1.1\nset xtics 30 offset 0,-0.3\nset ytics 30\nset zrange [0:*]\nset border 31\nunset colorbox\n"
          "set pm3d depthorder lighting primary 0.25 specular 0.1\n"
          "set palette defined (0 '#2c3f86', 0.3 '#3f86b5', 0.55 '#58b892', 0.8 '#dcd36a', 1 '#fff6cf')\nset key bottom center\n",
          g.script);
    draw_surface(g.script, has_lines(d), d->count > 0);
    return tsuya_gnuplot_end(&g);
}

/* Rays at 30° and two arcs under a polar diagram of radius `top`. */
static void polar_grid(FILE *f, double top)
{
    fprintf(f, "set size ratio -1\nset xrange [%g:%g]\nset yrange [0:%g]\nunset border\nunset tics\nunset grid\n", -1.12 * top, 1.12 * top, 1.12 * top);
    for (int k = -3; k <= 3; ++k) {
        double x = sin(k * M_PI / 6.0), y = cos(k * M_PI / 6.0);
        fprintf(f, "set arrow from 0,0 to %g,%g nohead lc rgb '#dddddd' back\nset label '%d°' at %g,%g center font ',8' textcolor rgb '#808080'\n", top * x,
                top * y, 30 * k, 1.06 * top * x, fmax(1.06 * top * y, 0.02 * top));
    }
    for (int k = 1; k <= 2; ++k) {
        double r = 0.5 * k * top;
        fprintf(f, "set object circle at 0,0 size %g arc [0:180] fs empty border lc rgb '#dddddd' behind\n"
                   "set label '%.2g' at %g,%g font ',8' textcolor rgb '#808080'\n", r, r, r * sin(0.26) + 0.01 * top, r * cos(0.26) - 0.03 * top);
    }
}

tsuya_status tsuya_plot_polar(const char *path, const tsuya_brdf_picture *p, const tsuya_plot_data *d)
{
    tsuya_gnuplot g;
    double top = 0.0, rest = half_rest_deg(&p->bench);
    for (int k = 0; k < d->azimuths * STEPS && has_lines(d); ++k) {
        top = fmax(top, intensity(p, d, d->azimuth_deg[k / STEPS], d->tilt_deg[0] + (d->tilt_deg[1] - d->tilt_deg[0]) * (k % STEPS) / (STEPS - 1)));
    }
    for (int k = 0; k < d->count; ++k) {
        top = fmax(top, d->point[k].intensity);
    }
    top = top > 0.0 ? top : 1.0;
    int columns = d->azimuths > 1 ? 2 : 1, rows = (d->azimuths + columns - 1) / columns;
    TSUYA_TRY(tsuya_gnuplot_begin(&g, path, 480 * columns, 60 + 300 * rows));
    write_curves(&g, p, d);
    fprintf(g.script, "set angles degrees\nset multiplot layout %d,%d title ", rows, columns);
    write_title(&g, p, d);
    fputc('\n', g.script);
    polar_grid(g.script, top);
    for (int k = 0; k < d->azimuths; ++k) {
        char name[48];
        azimuth_name(name, d->azimuth_deg[k]);
        fprintf(g.script, "set title '%s' offset 0,-0.5\nplot $line%d using ($2*sin(%g-$1)):($2*cos(%g-$1)) with lines lw 2 lc rgb '%s' notitle, "
                          "$point%d using ($2*sin(%g-$1)):($2*cos(%g-$1)) with points pt 7 ps 0.5 lc rgb '%s' notitle\n",
                name, k, rest, rest, color[k], k, rest, rest, has_lines(d) ? "#303030" : color[k]);
    }
    fputs("unset multiplot\n", g.script);
    return tsuya_gnuplot_end(&g);
}

tsuya_status tsuya_plot_errors(const char *path, const tsuya_plot_bars *b)
{
    tsuya_gnuplot g;
    TSUYA_TRY(tsuya_gnuplot_begin(&g, path, 1000, 560));
    fputs("$bars << EOD\n", g.script);
    for (int m = 0; m < b->models; ++m) {
        for (int s = 0; s < b->series; ++s) {
            write_number(g.script, b->value[m * b->series + s]);
            fputc(' ', g.script);
        }
        fprintf(g.script, "\"%s\\n%.3g ns\"\n", b->model[m], b->eval_ns[m]);
    }
    fprintf(g.script, "EOD\nset logscale y\nset ylabel 'error of cube roots'\nset style data histogram\nset style histogram clustered gap 1\n"
                      "set style fill solid 0.9 noborder\nset boxwidth 0.9\nunset grid\nset grid ytics lc rgb '#dddddd'\nset key outside top center horizontal\nset xtics scale 0\nset bmargin 3.5\n"
                      "set yrange [*:*]\nplot ");
    for (int s = 0; s < b->series; ++s) {
        fprintf(g.script, "%s$bars using %d:xtic(%d) title ", s ? ", " : "", s + 1, b->series + 1);
        tsuya_gnuplot_text(&g, b->name[s]);
        fprintf(g.script, " lc rgb '%s'", color[s % TSUYA_PLOT_AZIMUTHS]);
    }
    fputc('\n', g.script);
    return tsuya_gnuplot_end(&g);
}
