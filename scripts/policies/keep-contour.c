/* The feed follows the following error: where an axis lags more than it may, the feed falls until it does not, and comes
 * back slowly. Chatter of a drive, a worn guide or cold grease cost time then, not the contour. */
#include "../sdk/c/tandem_policy.h"

enum { ERROR, LOWEST, RECOVERY };

static tandem_parameter parameters[] = {
    [ERROR] = TANDEM_PARAMETER("axis_error_um", 20, 0.1, 10000, "Following error of an axis that is held, in micrometres"),
    [LOWEST] = TANDEM_PARAMETER("lowest_ratio", 0.2, 0.05, 1, "Feed ratio that is not gone below"),
    [RECOVERY] = TANDEM_PARAMETER("recovery_per_s", 1, 0.01, 100, "How fast the ratio comes back, in 1/s"),
};

/* A machine may have any of these; the linear ones are looked at. */
static tandem_input inputs[] = {TANDEM_OPTIONAL_AXIS("x"), TANDEM_OPTIONAL_AXIS("y"), TANDEM_OPTIONAL_AXIS("z")};

/* The ratio asked for last; it survives a reload. */
static double ratio = 1;

TANDEM_INPUTS(inputs)
TANDEM_POLICY_WITH_STATE(parameters, ratio)

TANDEM_ON_PERIOD(period) {
  double worst_mm = 0;
  for (int i = 0; i < 3; i++) {
    double error_mm = tandem_axis(period->max_axis_error, &inputs[i]);
    if (error_mm > worst_mm) worst_mm = error_mm;
  }
  double wanted = ratio + parameters[RECOVERY].value * period->duration_s;
  /* The error of a servo axis grows with its speed: the ratio that holds it is in proportion. */
  double holds = period->sigma * parameters[ERROR].value * 1e-3 / worst_mm;
  if (worst_mm > parameters[ERROR].value * 1e-3 && holds < wanted) wanted = holds;
  double lowest = parameters[LOWEST].value;
  ratio = wanted > 1 ? 1 : wanted < lowest ? lowest : wanted;
  return ratio;
}
