#include "app/gnuplot.h"

#include "core/file.h"
#include "core/process.h"

#include <string.h>
#include <unistd.h>

static void release(tsuya_gnuplot *plot)
{
    if (plot->script) {
        fclose(plot->script);
    }
    if (plot->script_path) {
        unlink(plot->script_path);
    }
    if (plot->temporary) {
        unlink(plot->temporary); /* renamed by now where all went well */
    }
    tsuya_free(plot->path);
    tsuya_free(plot->temporary);
    tsuya_free(plot->script_path);
    *plot = (tsuya_gnuplot){0};
}

void tsuya_gnuplot_text(const tsuya_gnuplot *plot, const char *text)
{
    fputc('\'', plot->script);
    for (const char *c = text; *c; ++c) {
        fputs(*c == '\'' ? "''" : "", plot->script);
        if (*c != '\'') {
            fputc((unsigned char)*c < 32 || *c == '`' ? ' ' : *c, plot->script);
        }
    }
    fputc('\'', plot->script);
}

tsuya_status tsuya_gnuplot_begin(tsuya_gnuplot *plot, const char *path, int width_px, int height_px)
{
    *plot = (tsuya_gnuplot){.path = tsuya_strdup(path)};
    tsuya_status status = plot->path ? tsuya_file_temporary_name(&plot->temporary, path) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        size_t size = strlen(plot->temporary) + 4;
        plot->script_path = tsuya_calloc(size, 1);
        status = plot->script_path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
        if (status == TSUYA_OK) {
            snprintf(plot->script_path, size, "%s.gp", plot->temporary);
            plot->script = fopen(plot->script_path, "w");
            status = plot->script ? TSUYA_OK : tsuya_fail_errno(path, "cannot write");
        }
    }
    if (status != TSUYA_OK) {
        release(plot);
        return status;
    }
    fprintf(plot->script, "set encoding utf8\nset terminal pngcairo size %d,%d noenhanced font 'DejaVu Sans,11' background '#ffffff'\nset output ",
            width_px, height_px);
    tsuya_gnuplot_text(plot, plot->temporary);
    fprintf(plot->script, "\nset border lc rgb '#707070'\nset tics textcolor rgb '#404040'\nset grid lc rgb '#dddddd' lt 1\n");
    return TSUYA_OK;
}

tsuya_status tsuya_gnuplot_end(tsuya_gnuplot *plot)
{
    const char *const argv[] = {"gnuplot", plot->script_path, NULL};
    bool bad = ferror(plot->script) != 0;
    bad |= fclose(plot->script) != 0;
    plot->script = NULL;
    tsuya_status status = bad ? tsuya_fail_errno(plot->path, "cannot write") : tsuya_process_run(NULL, argv, NULL);
    if (status == TSUYA_OK) {
        status = tsuya_file_rename_into_place(plot->temporary, plot->path);
    }
    release(plot);
    return status;
}
