/* The first cut after a rapid or a tool change begins at a fraction of the feed, and comes up to it over a length. Small
 * tools begin more gently still: a tool of a number up to delicate_tools is one of those. */
#define TANDEM_WITHOUT_GEOMETRY
#include "../sdk/c/tandem_policy.h"

enum { START, LENGTH, DELICATE, DELICATE_START };

static tandem_parameter parameters[] = {
    [START] = TANDEM_PARAMETER("start_ratio", 0.4, 0.05, 1, "Share of the feed at the first cut"),
    [LENGTH] = TANDEM_PARAMETER("ramp_mm", 10, 0.1, 10000, "Length of cut over which the feed comes up, in mm"),
    [DELICATE] = TANDEM_PARAMETER("delicate_tools", 0, 0, 10000, "Tools with numbers up to this one are delicate"),
    [DELICATE_START] = TANDEM_PARAMETER("delicate_start_ratio", 0.2, 0.05, 1, "Share of the feed at their first cut"),
};

/* What is known of the cut so far; it survives a reload. */
static struct cut {
  double length_mm;
  uint32_t tool;
} cut;

TANDEM_POLICY_WITH_STATE(parameters, cut)

TANDEM_ON_BLOCK(block) {
  if (block->kind == TANDEM_RAPID || block->tool != cut.tool) cut = (struct cut){0, block->tool};
  if (block->kind == TANDEM_RAPID || block->kind == TANDEM_DWELL) return;
  uint32_t delicate = block->tool > 0 && block->tool <= parameters[DELICATE].value;
  double start = parameters[delicate ? DELICATE_START : START].value;
  double share = start + (1 - start) * (cut.length_mm / parameters[LENGTH].value);
  if (share < 1) block->ask_feed_cap_mm_per_s = share * block->feed_mm_per_s;
  cut.length_mm += block->length_mm;
}
