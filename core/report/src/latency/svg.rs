//! The two drawings: counts by lateness, and the share that was later.

use std::fmt::Write;

use super::{LatencyBin, LatencySeries, scale::Scale};
use crate::chart::Chart;
use crate::text::number;

const CHART: Chart = Chart {
    width: 920.0,
    height: 250.0,
    area: AREA,
};
/// Where the drawing lies: left, right, top, bottom.
const AREA: [f64; 4] = [64.0, 900.0, 14.0, 214.0];

/// Bars, beside each other where there are two measurements.
pub fn histogram(series: &[LatencySeries]) -> String {
    let most = bins(series).map(|bin| bin.count).max().unwrap_or(0) as f64;
    // A count of one stands a little above the ground.
    let x = lateness(series);
    let y = Scale::new(0.5, most.max(1.0), AREA[3], AREA[2]);
    let mut bars = String::new();
    for (index, one) in series.iter().enumerate() {
        for bin in one.bins.iter().filter(|bin| bin.count > 0) {
            let (from, to) = (x.place(bin.from_us), x.place(bin.below_us));
            let width = (to - from) / series.len() as f64;
            let (left, top) = (from + width * index as f64, y.place(bin.count as f64));
            let _ = write!(
                bars,
                "<rect class=\"s{index}\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\">\
                 <title>{} to {} µs: {}</title></rect>",
                (width - 1.0).max(1.0),
                AREA[3] - top,
                number(bin.from_us),
                number(bin.below_us),
                bin.count
            );
        }
    }
    drawing(x, y, "wake-ups", &bars)
}

/// Stairs that fall from all of the wake-ups to the latest.
pub fn later(series: &[LatencySeries]) -> String {
    let most = series.iter().map(LatencySeries::count).max().unwrap_or(0) as f64;
    let x = lateness(series);
    let y = Scale::new(0.5 / most.max(1.0), 1.0, AREA[3], AREA[2]);
    let mut curves = String::new();
    for (index, one) in series.iter().enumerate().filter(|(_, one)| one.count() > 0) {
        let all = one.count();
        let mut left = all;
        let mut path = format!("M{:.1} {:.1}", AREA[0], y.place(1.0));
        for bin in &one.bins {
            left -= bin.count;
            // The latest is known exactly; its bin reaches further.
            let at = if left == 0 {
                one.percentiles_us[3].clamp(bin.from_us, bin.below_us)
            } else {
                bin.below_us
            };
            let share = if left == 0 {
                0.0
            } else {
                left as f64 / all as f64
            };
            let _ = write!(path, " H{:.1} V{:.1}", x.place(at), y.place(share));
        }
        let _ = write!(curves, "<path class=\"s{index}\" d=\"{path}\"/>");
    }
    drawing(x, y, "share later", &curves)
}

fn bins(series: &[LatencySeries]) -> impl Iterator<Item = &LatencyBin> {
    series.iter().flat_map(|one| &one.bins)
}

fn lateness(series: &[LatencySeries]) -> Scale {
    let low = bins(series)
        .map(|bin| bin.from_us)
        .fold(f64::INFINITY, f64::min);
    let high = bins(series)
        .map(|bin| bin.below_us)
        .fold(f64::NEG_INFINITY, f64::max);
    Scale::new(low.max(0.5), high, AREA[0], AREA[1])
}

/// Scales, grid and content.
fn drawing(x: Scale, y: Scale, what: &str, content: &str) -> String {
    let mut text = CHART.begin(&format!("{what} by lateness"));
    CHART.grid(x.places(), y.places(), &mut text);
    CHART.names("lateness, µs", what, 5.0, &mut text);
    text + content + "</svg>"
}

#[cfg(test)]
mod tests {
    use super::super::tests::series;
    use super::*;

    #[test]
    fn every_count_is_a_bar_and_the_stairs_end_on_the_ground() {
        let both = [series("a", &[5, 0, 1]), series("b", &[3, 90_000, 0])];
        assert_eq!(histogram(&both).matches("<rect").count(), 4);
        let stairs = later(&both);
        assert_eq!(stairs.matches("<path class=\"s").count(), 2);
        for path in stairs.split("<path class=\"s").skip(1) {
            assert!(path.contains(&format!("V{:.1}", AREA[3])), "{path}");
        }
    }
}
