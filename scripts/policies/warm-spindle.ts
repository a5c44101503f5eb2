// The feed follows a temperature: up to `warm_c` it is that of the program, from there it falls evenly, and at `hot_c` it is
// the lowest. The sensor is the analog input that the machine file calls `spindle_temperature_c`.
import { Period, parameter, signal } from "../sdk/assemblyscript/tandem-policy";
export { tandem_policy_v2 } from "../sdk/assemblyscript/tandem-policy";

const temperature = signal("spindle_temperature_c");
const warm = parameter("warm_c", 60, -50, 300, "Temperature up to which the feed is that of the program, in degrees Celsius");
const hot = parameter("hot_c", 80, -50, 300, "Temperature at which the feed is the lowest");
const lowest = parameter("lowest_ratio", 0.3, 0.05, 1, "Feed ratio of a hot spindle");

export function on_period(address: usize): f64 {
  const now = changetype<Period>(address).signal(temperature);
  // A sensor that is not heard of says nothing: whoever wants the machine to stop then has a role of an input for that.
  if (isNaN(now)) return NaN;
  const heat = (now - warm.value) / Math.max(hot.value - warm.value, 1e-3);
  return 1 - (1 - lowest.value) * Math.max(0, Math.min(1, heat));
}
