/* The votes of a vertex made one: the cross that most of them support. */
#ifndef TSUYA_WEAVE_DETECT_EVIDENCE_H
#define TSUYA_WEAVE_DETECT_EVIDENCE_H

#include "weave_detect/votes.h"

typedef struct tsuya_evidence {
    float a_rad, b_rad;         /* lines, unlabelled; where confidence > 0 */
    float period_a, period_b;
    float confidence;           /* probability that both are within 2 degrees of the threads */
    float weight;               /* how strongly it holds the field, [0, 1] */
    float flow_rad, flow_weight;
} tsuya_evidence;

/* Votes within AGREE of the best supported one are averaged, the others are left out; where many disagree the confidence falls. */
void tsuya_evidence_merge(tsuya_evidence *evidence, const tsuya_vote *vote, int count);

#endif
