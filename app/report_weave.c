/* The weft field on the surface. */
#include "app/report_parts.h"

void tsuya_report_weave(tsuya_report *report)
{
    (void)report;
}
