//! The layout of each SDK is that of the ABI.

use tandem_policy::abi::{block, period};

use crate::root;

/// Fields of a structure: name and offset.
type Fields = Vec<(String, usize)>;

const BLOCK: &[(&str, usize)] = &[
    ("size", block::SIZE),
    ("line", block::LINE),
    ("kind", block::KIND),
    ("tool", block::TOOL),
    ("flags", block::FLAGS),
    ("length_mm", block::LENGTH),
    ("feed_mm_per_s", block::FEED),
    ("turn_in_rad", block::TURN_IN),
    ("turn_out_rad", block::TURN_OUT),
    ("curvature_per_mm", block::CURVATURE),
    ("spindle_rad_per_s", block::SPINDLE),
    ("time_constant_s", block::TIME_CONSTANT),
    ("path_tolerance_mm", block::TOLERANCE),
    ("feed_cap_mm_per_s", block::FEED_CAP),
    ("ask_time_constant_s", block::ASK_TIME_CONSTANT),
    ("ask_path_tolerance_mm", block::ASK_TOLERANCE),
    ("ask_feed_cap_mm_per_s", block::ASK_FEED_CAP),
];

/// What version 2 appends.
const BLOCK_V2: &[(&str, usize)] = &[
    ("tool_diameter_mm", block::TOOL_DIAMETER),
    ("program", block::PROGRAM),
    ("start", block::START),
    ("end", block::END),
    ("offset", block::OFFSET),
    ("start_direction", block::START_DIRECTION),
    ("end_direction", block::END_DIRECTION),
    ("lowest_share", block::LOWEST_SHARE),
    ("highest_share", block::HIGHEST_SHARE),
];

const PERIOD: &[(&str, usize)] = &[
    ("size", period::SIZE),
    ("line", period::LINE),
    ("period", period::PERIOD),
    ("duration_s", period::DURATION),
    ("feed_mm_per_s", period::FEED),
    ("programmed_feed_mm_per_s", period::PROGRAMMED_FEED),
    ("following_error_mm", period::FOLLOWING_ERROR),
    ("max_following_error_mm", period::MAX_FOLLOWING_ERROR),
    ("cutting_torque_nm", period::CUTTING_TORQUE),
    ("reference_torque_nm", period::REFERENCE_TORQUE),
    ("spindle_load", period::SPINDLE_LOAD),
    ("spindle_rad_per_s", period::SPINDLE),
    ("distance_left_mm", period::DISTANCE_LEFT),
    ("ratio", period::RATIO),
    ("strategy_ratio", period::STRATEGY_RATIO),
    ("current_a", period::CURRENT),
];

/// What version 2 appends.
const PERIOD_V2: &[(&str, usize)] = &[
    ("position", period::POSITION),
    ("speed", period::SPEED),
    ("axis_error", period::AXIS_ERROR),
    ("max_axis_error", period::MAX_AXIS_ERROR),
    ("signals", period::SIGNALS),
    ("sigma", period::SIGMA),
];

/// Fields of the structure that begins behind `head` in `text`, and its size. A line of a field ends in `;` or `,`, before a
/// comment; `name_first` says that its type stands behind its name.
fn fields(text: &str, head: &str, name_first: bool) -> (Fields, usize) {
    let body = text.split_once(head).unwrap_or_else(|| panic!("{head}")).1;
    let (mut fields, mut offset) = (vec![], 0);
    for line in body
        .lines()
        .skip(1)
        .map(str::trim)
        .take_while(|line| !line.starts_with('}') && !line.contains("@inline"))
    {
        let code = line.split("/*").next().unwrap_or(line).trim_end();
        let Some(field) = code
            .strip_suffix([';', ','])
            .filter(|_| !line.starts_with(['/', '*']))
        else {
            continue;
        };
        let words: Vec<&str> = field
            .split([' ', ':'])
            .filter(|w| !["", "pub", "private"].contains(w))
            .collect();
        let (name, kind) = if name_first {
            (words[0], words[1])
        } else {
            (words[1], words[0])
        };
        let count = match (name.split_once('['), kind.starts_with('[')) {
            (Some((_, count)), _) => count.trim_end_matches(']').parse().unwrap(),
            (None, true) => words[2..].concat().trim_end_matches(']').parse().unwrap(),
            (None, false) => 1,
        };
        let bytes = if kind.contains("32") { 4 } else { 8 };
        assert_eq!(offset % bytes, 0, "{name} is not aligned");
        if name != "reserved" {
            fields.push((
                name.split('[')
                    .next()
                    .unwrap_or(name)
                    .replace("current_0_a", "current_a"),
                offset,
            ));
        }
        offset += count * bytes;
    }
    fields.retain(|(name, _)| !(name.starts_with("current_") && name != "current_a"));
    (fields, offset)
}

#[test]
fn every_sdk_lays_out_blocks_and_periods_as_the_abi_says() {
    let sdks = [
        (
            "rust/src/tandem_policy.rs",
            "pub struct Block {",
            "pub struct Period {",
            true,
        ),
        (
            "c/tandem_policy.h",
            "typedef struct tandem_block {",
            "typedef struct tandem_period {",
            false,
        ),
        (
            "assemblyscript/tandem-policy.ts",
            "export class Block {",
            "export class Period {",
            true,
        ),
    ];
    let named = |expected: &[(&str, usize)]| -> Fields {
        expected
            .iter()
            .map(|(name, offset)| ((*name).to_string(), *offset))
            .collect()
    };
    for (file, of_block, of_period, name_first) in sdks {
        let text = std::fs::read_to_string(root().join("scripts/sdk").join(file)).unwrap();
        // Classes of AssemblyScript hold no arrays: what version 2 appends is read by functions, which `sight` calls.
        let (blocks, periods) = if file.contains("assemblyscript") {
            ((named(BLOCK), block::BYTES), (named(PERIOD), period::BYTES))
        } else {
            (
                (named(&[BLOCK, BLOCK_V2].concat()), block::BYTES_V2),
                (named(&[PERIOD, PERIOD_V2].concat()), period::BYTES_V2),
            )
        };
        assert_eq!(fields(&text, of_block, name_first), blocks, "{file}");
        assert_eq!(fields(&text, of_period, name_first), periods, "{file}");
    }
}
