/* Cuts that go down into the material go slowly: so that the tool descends no faster than its plunge feed, which grows with
 * its diameter. Above the material, a height of the program, the feed is left alone. */
#include "../sdk/c/tandem_policy.h"

enum { PLUNGE, PLUNGE_OF_DIAMETER, SURFACE };

static tandem_parameter parameters[] = {
    [PLUNGE] = TANDEM_PARAMETER("plunge_mm_per_min", 200, 1, 100000, "Fastest descent of a tool of unknown diameter, mm/min"),
    [PLUNGE_OF_DIAMETER] = TANDEM_PARAMETER("plunge_per_diameter", 50, 1, 10000,
                                            "Fastest descent for each mm of the tool's diameter, mm/min"),
    [SURFACE] = TANDEM_PARAMETER("surface_mm", 0, -10000, 10000, "Top of the material along z, program coordinate, in mm"),
};

enum { Z };

static tandem_input inputs[] = {[Z] = TANDEM_AXIS("z")};

TANDEM_INPUTS(inputs)
TANDEM_POLICY(parameters)

TANDEM_ON_BLOCK(block) {
  double lowest = tandem_axis(block->lowest_share, &inputs[Z]);
  if (block->kind == TANDEM_RAPID || !(lowest < 0)) return;
  double start = tandem_axis(block->start, &inputs[Z]), end = tandem_axis(block->end, &inputs[Z]);
  double bottom = (start < end ? start : end) - tandem_axis(block->offset, &inputs[Z]);
  /* A curve may dip below both of its ends. */
  if (block->kind == TANDEM_LINE && bottom >= parameters[SURFACE].value) return;
  double plunge = block->tool_diameter_mm > 0 ? parameters[PLUNGE_OF_DIAMETER].value * block->tool_diameter_mm
                                              : parameters[PLUNGE].value;
  double most = plunge / 60 / -lowest;
  if (most < block->feed_mm_per_s) block->ask_feed_cap_mm_per_s = most;
}
