//! A planner with a defect.

use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockReport, Curve, Planner, PlannerDescription,
    PluginError, Segment, SegmentSink,
};

type Emits = dyn FnMut(&mut Segment) + Send;
type Describes = dyn Fn(&mut PlannerDescription) + Send;
type Advances = dyn FnMut(f64, &mut dyn SegmentSink, &mut Advanced) + Send;

/// Another planner, of whose answers a test changes some.
pub struct Bent {
    inner: Box<dyn Planner>,
    emits: Box<Emits>,
    describes: Box<Describes>,
    advances: Box<Advances>,
}

impl Bent {
    /// The planner as it is.
    pub fn new(inner: impl Planner + 'static) -> Self {
        Self::of(Box::new(inner))
    }

    /// The planner as it is.
    pub fn of(inner: Box<dyn Planner>) -> Self {
        Self {
            inner,
            emits: Box::new(|_| ()),
            describes: Box::new(|_| ()),
            advances: Box::new(|_, _, _| ()),
        }
    }

    /// `change` is done to each segment before it is emitted.
    #[must_use]
    pub fn emits(self, change: impl FnMut(&mut Segment) + Send + 'static) -> Self {
        let emits = Box::new(change);
        Self { emits, ..self }
    }

    /// `change` is done to what the planner says of itself.
    #[must_use]
    pub fn describes(self, change: impl Fn(&mut PlannerDescription) + Send + 'static) -> Self {
        let describes = Box::new(change);
        Self { describes, ..self }
    }

    /// `change` is called with the motion that was asked for, s, and with what the planner answers.
    #[must_use]
    pub fn advances(
        self,
        change: impl FnMut(f64, &mut dyn SegmentSink, &mut Advanced) + Send + 'static,
    ) -> Self {
        let advances = Box::new(change);
        Self { advances, ..self }
    }
}

struct BentSink<'a>(&'a mut dyn SegmentSink, &'a mut Emits);

impl SegmentSink for BentSink<'_> {
    fn segment(&mut self, segment: &Segment) {
        let mut segment = *segment;
        (self.1)(&mut segment);
        self.0.segment(&segment);
    }

    fn block(&mut self, report: &BlockReport) {
        self.0.block(report);
    }
}

impl Planner for Bent {
    fn describe(&self) -> PlannerDescription {
        let mut description = self.inner.describe();
        (self.describes)(&mut description);
        description
    }

    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.inner.check(block, curve)
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        self.inner.accept(block, curve)
    }

    fn finish(&mut self) {
        self.inner.finish();
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut bent = BentSink(sink, self.emits.as_mut());
        let mut advanced = self.inner.advance(duration_s, &mut bent)?;
        (self.advances)(duration_s, sink, &mut advanced);
        Ok(advanced)
    }

    fn reset(&mut self, position: &AxisVector) {
        self.inner.reset(position);
    }
}
