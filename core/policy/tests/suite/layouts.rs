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
        let Some((field, _)) = line
            .split_once([';', ','])
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
        let eight = name.contains("[8]") || kind.starts_with('[');
        let bytes = if kind.contains("32") { 4 } else { 8 };
        assert_eq!(offset % bytes, 0, "{name} is not aligned");
        if name != "reserved" {
            fields.push((
                name.trim_end_matches("[8]")
                    .replace("current_0_a", "current_a"),
                offset,
            ));
        }
        offset += if eight { 8 * bytes } else { bytes };
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
        assert_eq!(
            fields(&text, of_block, name_first),
            (named(BLOCK), block::BYTES),
            "{file}"
        );
        assert_eq!(
            fields(&text, of_period, name_first),
            (named(PERIOD), period::BYTES),
            "{file}"
        );
    }
}
