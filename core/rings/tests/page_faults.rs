//! The fine loop's first write to a sample slot maps no page.
#![allow(unsafe_code, reason = "page faults of a thread have no safe binding")]

use tandem_rings::{Sample, Sizes, bridge};

/// Pages mapped for the calling thread so far.
fn page_faults() -> i64 {
    // SAFETY: the structure holds numbers only, for which all zeros is a value.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: the pointer is to a structure of the right type that outlives the call.
    assert_eq!(
        unsafe { libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage) },
        0
    );
    usage.ru_minflt + usage.ru_majflt
}

#[test]
fn no_page_of_the_samples_is_mapped_while_they_are_written() {
    let sizes = Sizes {
        segments: 16,
        samples: 8192,
    };
    let fill = |push: &mut dyn FnMut(Sample) -> bool| {
        let before = page_faults();
        assert!((0..8192).all(|tick| push(Sample {
            tick,
            ..Sample::default()
        })));
        page_faults() - before
    };
    // The stack and the code of the measurement itself.
    let (_rough, mut fine, mut host) = bridge(sizes);
    fill(&mut |sample| fine.samples.push(sample).is_ok());
    assert_eq!(host.samples.pop().map(|sample| sample.tick), Ok(0));
    let (_rough, mut fine, _host) = bridge(sizes);
    assert_eq!(fill(&mut |sample| fine.samples.push(sample).is_ok()), 0);
    let (mut plain, _output) = rtrb::RingBuffer::new(8192);
    assert!(
        fill(&mut |sample| plain.push(sample).is_ok()) > 0,
        "an untouched ring is mapped while it is written"
    );
}
