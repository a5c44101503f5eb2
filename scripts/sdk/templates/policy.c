/* Blocks with a sharp turn at either end are driven at most at a feed of the machine's own. */
#include "tandem_policy.h"

enum { TURN, FEED };

/* [policy.parameters] of the machine file: name, default, lowest, highest, what it means. */
static tandem_parameter parameters[] = {
    [TURN] = TANDEM_PARAMETER("sharp_turn_deg", 30, 1, 180, "Turn from which a corner counts as sharp, in degrees"),
    [FEED] = TANDEM_PARAMETER("sharp_feed_mm_per_min", 1200, 1, 100000, "Highest feed beside a sharp corner, mm/min"),
};

TANDEM_POLICY(parameters)

/* Called for every block, in the order of the program. What is not asked for stays as it is. */
TANDEM_ON_BLOCK(block) {
  if (block->kind == TANDEM_RAPID || block->kind == TANDEM_DWELL) return;
  double sharpest = block->turn_in_rad > block->turn_out_rad ? block->turn_in_rad : block->turn_out_rad;
  if (sharpest * 57.29577951308232 >= parameters[TURN].value)
    block->ask_feed_cap_mm_per_s = parameters[FEED].value / 60;
}
