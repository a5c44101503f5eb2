// The feed follows the load: torque above the reference takes feed away at once, torque below gives it back slowly. The
// torque is the estimate of the feed strategy where there is one; without one the motor current of the loaded axis stands
// in for it.
import { Parameter, Period, keepState, parameter } from "../sdk/assemblyscript/tandem-policy";
export { tandem_policy_v2 } from "../sdk/assemblyscript/tandem-policy";

const current: Parameter = parameter("reference_current_a", 4, 0.01, 1000, "Current that counts as full load, in A, where no torque is estimated");
const lowest: Parameter = parameter("lowest_ratio", 0.3, 0.05, 1, "Feed ratio that is not gone below");
const highest: Parameter = parameter("highest_ratio", 1, 0.1, 2, "Feed ratio that is not exceeded");
const recovery: Parameter = parameter("recovery_per_s", 0.5, 0.01, 100, "How fast the ratio comes back, in 1/s");

// The ratio, which a reload hands over.
const STATE: usize = memory.data(8, 8);
store<f64>(STATE, 1);
keepState(STATE, 8);

function loadOf(period: Period): f64 {
  const torque = period.cutting_torque_nm / period.reference_torque_nm;
  if (isFinite(torque)) return Math.abs(torque);
  const x = Math.max(period.current_0_a, period.current_1_a);
  return Math.max(x, period.current_2_a) / current.value;
}

export function on_period(address: usize): f64 {
  const period = changetype<Period>(address);
  const last = load<f64>(STATE);
  const most = last + recovery.value * period.duration_s;
  const wanted = Math.min(most, last / Math.max(loadOf(period), 1e-3));
  const ratio = Math.max(lowest.value, Math.min(highest.value, wanted));
  store<f64>(STATE, ratio);
  return ratio;
}

export function save(): i32 {
  return 8;
}

export function restore(_bytes: i32): void {}
