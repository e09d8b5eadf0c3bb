#include "brdf/weave_draft.h"

#include "core/file.h"
#include "core/table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static tsuya_status create(tsuya_draft *d, int ends, int picks)
{
    *d = (tsuya_draft){ends, picks, tsuya_calloc((size_t)ends * (size_t)picks, 1)};
    return d->warp_up ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

void tsuya_draft_free(tsuya_draft *draft)
{
    tsuya_free(draft->warp_up);
    *draft = (tsuya_draft){0};
}

static int common_divisor(int a, int b) { return b == 0 ? a : common_divisor(b, a % b); }

static tsuya_status create_twill(tsuya_draft *d, int over, int under)
{
    int n = over + under;
    TSUYA_TRY(create(d, n, n));
    for (int pick = 0; pick < n; ++pick) {
        for (int end = 0; end < n; ++end) {
            d->warp_up[pick * n + end] = (pick - end + n) % n < over;
        }
    }
    return TSUYA_OK;
}

static tsuya_status create_satin(tsuya_draft *d, const char *name, int n, int step, bool warp_faced)
{
    for (int s = 2; step == 0 && s < n - 1; ++s) {
        step = common_divisor(n, s) == 1 ? s : 0;
    }
    if (n < 5 || step < 2 || step > n - 2 || common_divisor(n, step) != 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "weave '%s': a satin has at least 5 ends, and its step is from 2 to their number less 2 without a common divisor", name);
    }
    TSUYA_TRY(create(d, n, n));
    for (int pick = 0; pick < n; ++pick) {
        for (int end = 0; end < n; ++end) {
            d->warp_up[pick * n + end] = (end == pick * step % n) != warp_faced;
        }
    }
    return TSUYA_OK;
}

/* WIF */
typedef struct wif {
    const char *name;
    int warps, wefts, shafts, treadles;
    bool sinking, lifts;
    unsigned char *thread, *tie, *step; /* [warp][shaft], [treadle][shaft], [weft][treadle] or [weft][shaft] */
} wif;

typedef enum wif_part { OTHER, WEAVING, WARP, WEFT, THREADING, TIEUP, TREADLING, LIFTPLAN } wif_part;

static wif_part part_of(const char *line)
{
    static const char *const name[] = {"", "[WEAVING]", "[WARP]", "[WEFT]", "[THREADING]", "[TIEUP]", "[TREADLING]", "[LIFTPLAN]"};
    for (int k = WEAVING; k <= LIFTPLAN; ++k) {
        if (strncasecmp(line, name[k], strlen(name[k])) == 0) {
            return (wif_part)k;
        }
    }
    return OTHER;
}

static tsuya_status whole(int *number, const wif *w, int line, const char *text, int low, int high)
{
    long long value;
    if (!tsuya_parse_int(&value, text) || value < low || value > high) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: '%.40s': expected a whole number from %d to %d", w->name, line, text, low, high);
    }
    *number = (int)value;
    return TSUYA_OK;
}

/* "KEY=1,3,4": marks bits of a row; 0 means none. */
static tsuya_status mark(unsigned char *bits, int rows, int columns, const wif *w, int line, const char *key, char *values)
{
    int row = 1, column = 0;
    TSUYA_TRY(whole(&row, w, line, key, 1, rows));
    for (char *rest = NULL, *v = strtok_r(values, ", \t", &rest); v; v = strtok_r(NULL, ", \t", &rest)) {
        TSUYA_TRY(whole(&column, w, line, v, 0, columns));
        if (column > 0) {
            bits[(size_t)(row - 1) * TSUYA_DRAFT_SHAFTS + (size_t)column - 1] = 1;
        }
    }
    return TSUYA_OK;
}

static tsuya_status take(wif *w, wif_part part, int line, const char *key, char *value)
{
    switch (part) {
    case WEAVING:
        if (strcasecmp(key, "Shafts") == 0) {
            return whole(&w->shafts, w, line, value, 1, TSUYA_DRAFT_SHAFTS);
        }
        if (strcasecmp(key, "Treadles") == 0) {
            return whole(&w->treadles, w, line, value, 1, TSUYA_DRAFT_SHAFTS);
        }
        if (strcasecmp(key, "Rising Shed") == 0) {
            w->sinking = strchr("0fFnN", value[0]) != NULL || strcasecmp(value, "off") == 0;
        }
        return TSUYA_OK;
    case WARP: return strcasecmp(key, "Threads") == 0 ? whole(&w->warps, w, line, value, 1, TSUYA_DRAFT_MOST) : TSUYA_OK;
    case WEFT: return strcasecmp(key, "Threads") == 0 ? whole(&w->wefts, w, line, value, 1, TSUYA_DRAFT_MOST) : TSUYA_OK;
    case THREADING: return mark(w->thread, TSUYA_DRAFT_MOST, TSUYA_DRAFT_SHAFTS, w, line, key, value);
    case TIEUP: return mark(w->tie, TSUYA_DRAFT_SHAFTS, TSUYA_DRAFT_SHAFTS, w, line, key, value);
    case LIFTPLAN: w->lifts = true; return mark(w->step, TSUYA_DRAFT_MOST, TSUYA_DRAFT_SHAFTS, w, line, key, value);
    case TREADLING: return w->lifts ? TSUYA_OK : mark(w->step, TSUYA_DRAFT_MOST, TSUYA_DRAFT_SHAFTS, w, line, key, value);
    case OTHER: break;
    }
    return TSUYA_OK;
}

static char *trim(char *text)
{
    text += strspn(text, " \t\r");
    for (size_t n = strlen(text); n > 0 && strchr(" \t\r", text[n - 1]); --n) {
        text[n - 1] = '\0';
    }
    return text;
}

static tsuya_status read_lines(wif *w, char *text)
{
    wif_part part = OTHER;
    int line = 0;
    for (char *rest = text, *one; (one = strsep(&rest, "\n")) != NULL;) {
        line++;
        one = trim(one);
        if (one[0] == '[') {
            part = part_of(one);
            if (part == LIFTPLAN) {
                memset(w->step, 0, (size_t)TSUYA_DRAFT_MOST * TSUYA_DRAFT_SHAFTS);
            }
            continue;
        }
        char *equals = strchr(one, '=');
        if (equals && one[0] != ';') {
            *equals = '\0';
            char *comment = strchr(equals + 1, ';');
            if (comment) {
                *comment = '\0';
            }
            TSUYA_TRY(take(w, part, line, trim(one), trim(equals + 1)));
        }
    }
    return TSUYA_OK;
}

static bool raised(const wif *w, int warp, int weft)
{
    const unsigned char *on = w->thread + (size_t)warp * TSUYA_DRAFT_SHAFTS, *step = w->step + (size_t)weft * TSUYA_DRAFT_SHAFTS;
    bool moved = false;
    for (int s = 0; s < TSUYA_DRAFT_SHAFTS; ++s) {
        bool pulled = w->lifts && step[s];
        for (int t = 0; !w->lifts && t < TSUYA_DRAFT_SHAFTS; ++t) {
            pulled |= step[t] && w->tie[(size_t)t * TSUYA_DRAFT_SHAFTS + (size_t)s];
        }
        moved |= on[s] && pulled;
    }
    return moved != w->sinking;
}

static tsuya_status weave(tsuya_draft *d, const wif *w)
{
    if (w->warps == 0 || w->wefts == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: [WARP] and [WEFT] do not both say Threads=", w->name);
    }
    TSUYA_TRY(create(d, w->warps, w->wefts));
    int up = 0;
    for (int pick = 0; pick < w->wefts; ++pick) {
        for (int end = 0; end < w->warps; ++end) {
            up += d->warp_up[pick * w->warps + end] = raised(w, end, pick);
        }
    }
    if (up == 0 || up == w->warps * w->wefts) {
        tsuya_draft_free(d);
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no yarn of one system ever crosses the other; are [THREADING], [TIEUP] and [TREADLING] or [LIFTPLAN] there?", w->name);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_draft_parse(tsuya_draft *draft, const char *text, const char *name)
{
    wif w = {.name = name};
    char *copy = tsuya_strdup(text);
    size_t shafts = TSUYA_DRAFT_SHAFTS;
    tsuya_status status = copy ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    *draft = (tsuya_draft){0};
    TSUYA_NEW(status, w.thread, TSUYA_DRAFT_MOST * shafts);
    TSUYA_NEW(status, w.step, TSUYA_DRAFT_MOST * shafts);
    TSUYA_NEW(status, w.tie, shafts * shafts);
    if (status == TSUYA_OK) {
        status = read_lines(&w, copy);
    }
    if (status == TSUYA_OK) {
        status = weave(draft, &w);
    }
done:
    tsuya_free(copy);
    tsuya_free(w.thread);
    tsuya_free(w.step);
    tsuya_free(w.tie);
    return status;
}

tsuya_status tsuya_draft_create(tsuya_draft *draft, const char *name)
{
    int a = 0, b = 0, used = -1;
    *draft = (tsuya_draft){0};
    if (strcasecmp(tsuya_path_extension(name), ".wif") == 0) {
        char *text;
        size_t size;
        TSUYA_TRY(tsuya_file_load(&text, &size, name, (size_t)16 << 20));
        tsuya_status status = tsuya_draft_parse(draft, text, name);
        tsuya_free(text);
        return status;
    }
    size_t length = strlen(name);
    if (length < 32 && strcmp(name, "plain") == 0) {
        return create_twill(draft, 1, 1);
    }
    if (length < 32 && sscanf(name, "twill-%4d/%4d%n", &a, &b, &used) == 2 && used == (int)length && a > 0 && b > 0 && a + b <= 64) {
        return create_twill(draft, a, b);
    }
    bool sateen = strncmp(name, "sateen-", 7) == 0;
    const char *rest = sateen ? name + 7 : strncmp(name, "satin-", 6) == 0 ? name + 6 : NULL;
    if (rest && length < 32) {
        int parts = sscanf(rest, "%4d%n/%4d%n", &a, &used, &b, &used);
        if (parts >= 1 && used == (int)strlen(rest) && a > 0 && a <= 64 && b >= 0) {
            return create_satin(draft, name, a, b, !sateen);
        }
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "weave '%.60s': expected plain, twill-N/M, satin-N, satin-N/S, sateen-N/S or FILE.wif", name);
}
