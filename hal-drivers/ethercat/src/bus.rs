//! A bus that is up: one exchange in a period, and what is known of every device.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};

use tandem_ethercat_emulator::BusDescription;
use tandem_sdk::{
    Attached, AxisVector, DriverContext, Feedback, JointState, MAX_AXES, MAX_DIGITAL, Setpoint,
};

use crate::bring_up::{self, Ready, refuses};
use crate::check::emulated;
use crate::clock::{Leading, phase};
use crate::cyclic::Cyclic;
use crate::drive::{Drive, Moves};
use crate::link::Link;
use crate::mailboxes::Mailboxes;
use crate::master::Master;
use crate::member::{Member, OP};
use crate::options::{EMULATED, Encoder, Options, Sync};
use crate::requests::{ObjectServer, Request};
use crate::survey::{Object, Value};
use crate::time;
use crate::words::{al_code, al_state, own};

/// Share of a period that a reply is waited for: what is left is the host's.
const REPLY_SHARE: f64 = 0.6;

/// How long all devices together may take for OP, s: drives first find SYNC0 and build up their loops.
const OP_S: f64 = 10.0;

/// Share of the phase error by which a bus that is brought up, or runs on virtual time, is steered in a period, and the most that
/// it is steered at once, share of a period. On the wall clock the host steers.
const STEER_SHARE: f64 = 0.1;
const MAX_STEER_SHARE: f64 = 0.05;

/// Share of a period before an exchange in which no other frame is sent: its reply would come in between.
const QUIET_SHARE: f64 = 0.3;

/// Exchanges before OP is asked for: clocks and drives settle.
const SETTLE_EXCHANGES: u64 = 60;

/// A device has refused a state.
const ERROR: u16 = 0x10;

/// Objects that the driver tells its drives in every period: nobody else writes them.
const OF_THE_DRIVER: [u16; 8] = [
    0x6040, 0x6060, 0x6072, 0x607A, 0x60B1, 0x60B2, 0x60B8, 0x60FF,
];

/// What is asked of an object, on its way through the gaps between exchanges.
type Job = Pin<Box<dyn Future<Output = Result<Value, String>> + Send>>;

/// How a device is.
pub(crate) struct Seen<'a> {
    pub(crate) called: &'a str,
    /// Registers 0x0130 and 0x0134.
    pub(crate) al: u16,
    pub(crate) al_code: u16,
    /// Status word of a drive.
    pub(crate) status: Option<u16>,
    /// Why it counts as lost.
    pub(crate) lost: Option<u32>,
}

/// Exchanges and what became of them, since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Exchanges.
    pub exchanges: u64,
    /// Exchanges whose reply did not come in time.
    pub lost: u64,
    /// Frames that came and were none that was awaited: late, twice, another master's.
    pub strays: u64,
    /// Answers of devices that took no part in a frame that came back.
    pub short: u64,
}

/// A bus, powered and maybe up.
pub(crate) struct Bus {
    options: Options,
    context: DriverContext,
    link: Link,
    master: Option<Master>,
    mailboxes: Option<Arc<Mailboxes>>,
    job: Option<Job>,
    answer: Option<Result<Value, String>>,
    cyclic: Option<Cyclic>,
    members: Vec<Member>,
    period_ns: u64,
    /// When the next exchange is due, where the driver itself keeps time.
    next_ns: u64,
    /// When the last exchange began.
    begun_ns: u64,
    asks: usize,
    last: Setpoint,
    phase_ns: Option<i64>,
    /// The clock that leads; none where frames do.
    leading: Option<Leading>,
    /// Frames in a row that came back without the time of the clock that leads.
    clock_misses: u32,
    pub(crate) counters: Counters,
    sent: bool,
}

impl Bus {
    /// Takes the interface, or gives an emulated bus its power.
    pub(crate) fn open(options: &Options, context: &DriverContext) -> Result<Self, String> {
        let link = if options.interface == EMULATED {
            let description: BusDescription =
                emulated(options, context).map_err(|error| error.to_string())?;
            Link::emulated(&description, context.real_time != 0)?
        } else {
            Link::interface(&options.interface)?
        };
        let master = Master::take(options.sync == Sync::Dc);
        let master = master.ok_or_else(|| "there is no memory for another bus".to_string())?;
        Ok(Self {
            options: options.clone(),
            context: *context,
            link,
            master: Some(master),
            mailboxes: None,
            job: None,
            answer: None,
            cyclic: None,
            members: vec![],
            period_ns: (context.fine_period_s * 1e9).round() as u64,
            next_ns: 0,
            begun_ns: 0,
            asks: 0,
            last: Setpoint::default(),
            phase_ns: None,
            leading: None,
            clock_misses: 0,
            counters: Counters::default(),
            sent: false,
        })
    }

    /// What its frames go over.
    pub(crate) fn link_mut(&mut self) -> &mut Link {
        &mut self.link
    }

    /// Brings the bus into OP, and tells where the joints stand.
    pub(crate) fn start(&mut self) -> Result<Attached, String> {
        let Self {
            options,
            context,
            link,
            master,
            ..
        } = self;
        let master = master
            .as_mut()
            .ok_or_else(|| "the bus is closed".to_string())?;
        link.renew(&options.interface)?;
        let up = master.run(link, |main| bring_up::bring_up(main, options, context))?;
        let stations: Vec<_> = up.devices.iter().map(|device| device.station).collect();
        let mut cyclic = Cyclic::new(&stations, up.reference.map(|(station, _)| station))?;
        self.leading = up.reference.map(|(_, leading)| leading);
        cyclic.ask(0);
        self.cyclic = Some(cyclic);
        self.mailboxes = Some(Arc::new(up.mailboxes));
        let member = |ready: Ready| Member {
            inputs: vec![0; ready.station.inputs.bytes],
            ready,
            silent: 0,
            lost: None,
            al: 4,
            al_code: 0,
        };
        self.members = up.devices.into_iter().map(member).collect();
        (self.last, self.counters, self.phase_ns) =
            (Setpoint::default(), Counters::default(), None);
        self.asks = 0;
        self.sent = false;
        self.clock_misses = 0;
        self.next_ns = self.link.now_ns();
        self.come_into_op()?;
        Ok(self.attached())
    }

    /// Exchanges until every device is in OP.
    fn come_into_op(&mut self) -> Result<(), String> {
        let most = (OP_S / self.context.fine_period_s) as u64;
        for exchange in 0..most {
            let asked = exchange
                .checked_sub(SETTLE_EXCHANGES)
                .map(|n| n as usize)
                .filter(|n| *n < self.members.len());
            if let Some(cyclic) = &mut self.cyclic {
                cyclic.request(asked.map(|device| (device, OP)));
            }
            self.turn();
            if exchange == 0 || exchange == SETTLE_EXCHANGES {
                self.begin_drives();
            }
            for member in &self.members {
                if member.al & ERROR != 0 {
                    return Err(refuses(&member.ready.called, OP, member.al, member.al_code));
                }
            }
            let all = self
                .members
                .iter()
                .all(|member| member.al & 0x0f == OP && member.silent == 0);
            if all {
                self.begin_drives();
                return Ok(());
            }
        }
        Err(self.why_not_op())
    }

    fn begin_drives(&mut self) {
        for member in &mut self.members {
            if let Some(drive) = &mut member.ready.drive {
                drive.begin(&member.inputs);
            }
        }
    }

    fn why_not_op(&self) -> String {
        let late = self
            .members
            .iter()
            .find(|member| member.al & 0x0f != OP || member.silent > 0);
        late.map_or_else(String::new, |member| {
            let (called, al) = (&member.ready.called, al_state(member.al));
            if self.counters.lost > self.counters.exchanges / 2 {
                return format!(
                    "{} of {} frames did not come back on the way to OP",
                    self.counters.lost, self.counters.exchanges
                );
            }
            if member.al & 0x0f == OP {
                return format!(
                    "{called}: it is in OP, and does not take part in the exchange of process data"
                );
            }
            format!(
                "{called}: it stays in {al} and does not come to OP within {OP_S} s: {:04X}, {}",
                member.al_code,
                al_code(member.al_code)
            )
        })
    }

    /// One exchange at the time when it is due, with what was sent last.
    pub(crate) fn turn(&mut self) {
        let setpoint = self.last;
        self.link.wait_until(self.next_ns);
        self.exchange_at_once(&setpoint);
        self.steer();
    }

    /// When the next exchange is due: a period later, and towards the phase where clocks lead.
    fn steer(&mut self) {
        let most = self.period_ns as f64 * MAX_STEER_SHARE;
        let by = self
            .phase_ns
            .map_or(0.0, |phase| (phase as f64 * STEER_SHARE).clamp(-most, most));
        self.next_ns = (self.next_ns + self.period_ns).saturating_add_signed(-(by as i64));
        if !self.link.is_virtual() {
            // A wait that was too long is not made up for by exchanges in a row.
            self.next_ns = self.next_ns.max(self.link.now_ns());
        }
    }

    /// Begins the exchange of a period: on virtual time, the period goes by first.
    pub(crate) fn send(&mut self, setpoint: &Setpoint) {
        if self.link.is_virtual() {
            self.work(self.next_ns);
            self.link.wait_until(self.next_ns);
            self.steer();
        }
        self.lay_out(setpoint);
        if let Some(cyclic) = &mut self.cyclic {
            cyclic.send(&mut self.link);
        }
        self.sent = true;
    }

    /// The exchange of a period, for the host.
    pub(crate) fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) {
        if !self.sent {
            self.send(setpoint);
        }
        self.take_in();
        self.report(setpoint, feedback);
    }

    /// An exchange while the host does not ask for one: enabled joints hold where they were told to be last.
    pub(crate) fn keep_alive(&mut self) {
        let mut setpoint = self.last;
        let moving = setpoint.velocity.0[..MAX_AXES]
            .iter()
            .any(|velocity| *velocity != 0.0);
        if moving {
            for member in &mut self.members {
                if let Some(drive) = &mut member.ready.drive {
                    drive.fall_silent(true);
                }
            }
        }
        (setpoint.velocity, setpoint.acceleration) = (AxisVector::ZERO, AxisVector::ZERO);
        (setpoint.reset, setpoint.arm) = (0, tandem_sdk::Arm::default());
        self.exchange_at_once(&setpoint);
    }

    /// Sends the last frame once more; whether it came back within a period. Nothing is made of what it says.
    pub(crate) fn send_again(&mut self) -> bool {
        let until_ns = self.link.now_ns() + self.period_ns;
        let cyclic = self.cyclic.as_mut();
        cyclic.is_some_and(|cyclic| cyclic.send_again(&mut self.link, until_ns))
    }

    fn exchange_at_once(&mut self, setpoint: &Setpoint) {
        self.lay_out(setpoint);
        if let Some(cyclic) = &mut self.cyclic {
            cyclic.send(&mut self.link);
        }
        self.take_in();
    }

    fn lay_out(&mut self, setpoint: &Setpoint) {
        self.last = *setpoint;
        self.begun_ns = self.link.now_ns();
        let Some(cyclic) = &mut self.cyclic else {
            return;
        };
        for (number, member) in self.members.iter_mut().enumerate() {
            let out = cyclic.outputs(number);
            if let Some(drive) = &mut member.ready.drive {
                drive.command(setpoint, out);
                continue;
            }
            let lines = &self.options.devices[member.ready.options].outputs;
            for (bit, line) in lines.iter().enumerate().filter(|(_, line)| **line >= 0) {
                let Some(byte) = out.get_mut(bit / 8) else {
                    break;
                };
                let mask = 1 << (bit % 8);
                let on = setpoint.outputs >> line & 1 == 1;
                *byte = if on { *byte | mask } else { *byte & !mask };
            }
        }
        cyclic.ask(self.asks);
    }

    /// Waits for the reply and takes in what it says.
    fn take_in(&mut self) {
        let Some(cyclic) = &mut self.cyclic else {
            return;
        };
        self.sent = false;
        let wait_ns = (self.period_ns as f64 * REPLY_SHARE) as u64;
        let until_ns = self.link.now_ns() + wait_ns;
        let came = cyclic.receive(&mut self.link, until_ns);
        self.counters.exchanges += 1;
        self.counters.lost += u64::from(!came);
        self.counters.strays = cyclic.strays;
        let status = if came { cyclic.al_status() } else { None };
        if let Some(status) = status {
            let member = &mut self.members[status.device];
            (member.al, member.al_code) = (status.status, status.code);
        }
        for (number, member) in self.members.iter_mut().enumerate() {
            let inputs = if came { cyclic.inputs(number) } else { None };
            if let Some(inputs) = inputs.filter(|_| cyclic.took(number)) {
                member.silent = 0;
                member.inputs.copy_from_slice(inputs);
                if let Some(drive) = &mut member.ready.drive {
                    drive.answer(&member.inputs);
                }
            } else {
                self.counters.short += u64::from(came);
                member.miss(came, self.options.max_lost_frames);
            }
        }
        let clock_ns = if came { cyclic.clock_ns() } else { None };
        self.clock_misses = if came && cyclic.has_clock() && clock_ns.is_none() {
            self.clock_misses + 1
        } else if came {
            0
        } else {
            self.clock_misses
        };
        if self.clock_misses > self.options.max_lost_frames {
            for member in &mut self.members {
                if member.ready.drive.is_some() {
                    member.lost.get_or_insert(own::NO_CLOCK);
                }
            }
        }
        let now_ns = self.link.now_ns();
        self.phase_ns = clock_ns
            .zip(self.leading.as_mut())
            .map(|(shown_ns, leading)| leading.time_ns(shown_ns, now_ns))
            .map(|clock_ns| phase(clock_ns, self.period_ns, self.options.phase_us));
        self.ask_on(came);
    }

    /// Whose state is asked for next: of a device that takes no part, else of one after the other.
    fn ask_on(&mut self, came: bool) {
        let count = self.members.len().max(1);
        let from = self.asks + 1;
        let silent = (from..from + count)
            .map(|n| n % count)
            .find(|n| came && self.members.get(*n).is_some_and(|m| m.silent > 0));
        self.asks = silent.unwrap_or(from % count);
    }

    /// Writes everything that is known.
    fn report(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) {
        feedback.latches = [tandem_sdk::Latch::default(); tandem_sdk::MAX_LATCHES];
        let mut latches = 0;
        let mut spindle_trouble = None;
        let mut without_joint = None;
        for member in &mut self.members {
            let options = &self.options.devices[member.ready.options];
            if member.lost.is_none() {
                member.read_lines(options, feedback);
            }
            let age = u16::try_from(member.silent).unwrap_or(u16::MAX);
            for line in options.inputs.iter().filter(|line| **line >= 0) {
                feedback.input_age_periods[*line as usize % MAX_DIGITAL] = age;
            }
            let (lost, silent) = (member.lost, member.silent);
            if let Some(why) = lost.filter(|_| options.joint.is_none() && options.is_used()) {
                without_joint.get_or_insert(own::of_device(member.ready.options, why));
            }
            let Some(drive) = &mut member.ready.drive else {
                continue;
            };
            drive.report(lost, feedback);
            match drive.moves() {
                Moves::Joint(joint) => {
                    feedback.age_periods[joint] = silent;
                    if let Some(latch) = drive.take_latch() {
                        latches = merge(&mut feedback.latches, latches, latch);
                    }
                }
                Moves::Spindle { at_speed_share, .. } => {
                    let (state, code) = drive.state();
                    spindle_trouble =
                        (lost.is_none() && state == JointState::Fault).then_some(code);
                    let at_speed = drive.is_at_speed(setpoint.spindle_rad_per_s, at_speed_share);
                    let turns = spindle_trouble.or(lost).is_none() && at_speed;
                    feedback.spindle_at_speed = u32::from(turns);
                }
            }
        }
        // The contract has no state for a spindle and none for a terminal: what stops the axes on their ramps is a joint's.
        let joints = self.context.joint_count as usize;
        let all_hold = feedback.state[..joints]
            .iter()
            .all(|state| *state == JointState::Enabled);
        if let Some(code) = spindle_trouble.filter(|_| joints > 0 && all_hold) {
            (feedback.state[0], feedback.fault_code[0]) = (JointState::Fault, own::SPINDLE + code);
        }
        // A joint that has a reason of its own has the better one, and one that is being let go of is waited for.
        let has_reason = |state: &JointState| [JointState::Fault, JointState::Lost].contains(state);
        let is_told = joints > 0
            && feedback.state[0] != JointState::QuickStop
            && !feedback.state[..joints].iter().any(has_reason);
        if let Some(code) = without_joint.filter(|_| is_told) {
            (feedback.state[0], feedback.fault_code[0]) = (JointState::Lost, code);
        }
        // Where nothing was heard, the clock is not steered by what was heard before.
        (feedback.has_phase, feedback.phase_ns) =
            self.phase_ns.map_or((0, 0), |phase_ns| (1, phase_ns));
    }

    /// Where the joints stand.
    fn attached(&mut self) -> Attached {
        let mut feedback = Feedback::default();
        let setpoint = self.last;
        self.report(&setpoint, &mut feedback);
        let delay = self
            .options
            .delay_periods
            .unwrap_or(if self.options.sync == Sync::Dc { 2 } else { 1 });
        let mut attached = Attached::at(feedback.position);
        (attached.state, attached.fault_code) = (feedback.state, feedback.fault_code);
        attached.delay_periods = [delay; MAX_AXES];
        for member in &self.members {
            let options = &self.options.devices[member.ready.options];
            if let (Some(Moves::Joint(joint)), Encoder::Incremental) = (
                member.ready.drive.as_ref().map(Drive::moves),
                options.encoder,
            ) {
                attached.known &= !(1 << joint);
                attached.homed &= !(1 << joint);
            }
        }
        attached
    }

    /// The drives come to rest by their own means.
    pub(crate) fn quick_stop(&mut self) {
        for member in &mut self.members {
            if let Some(drive) = &mut member.ready.drive {
                drive.quick_stop();
            }
        }
    }

    /// Takes the torque from the drives and the bus to INIT.
    pub(crate) fn stop(&mut self) {
        if self.cyclic.take().is_some()
            && let Some(master) = &mut self.master
        {
            master.run(&mut self.link, bring_up::leave);
        }
        self.members.clear();
        self.mailboxes = None;
        if self.job.take().is_some() {
            self.answer = Some(Err("the bus was stopped".to_string()));
        }
    }

    /// Until when other frames may be on their way before the next exchange; none where it is due, or so near that they would not
    /// be back.
    pub(crate) fn gap_ends_ns(&self) -> Option<u64> {
        let quiet_ns = (self.period_ns as f64 * QUIET_SHARE) as u64;
        let left_ns = self.next_ns.saturating_sub(self.link.now_ns());
        (left_ns > quiet_ns).then_some(self.next_ns)
    }

    fn called(&self, place: usize) -> Result<String, String> {
        let member = self.members.get(place);
        member.map(|m| m.ready.called.clone()).ok_or_else(|| {
            format!(
                "there is no device {place}: {} are on the bus, from 0",
                self.members.len()
            )
        })
    }

    /// Reads an object of the device at a place, and exchanges meanwhile. Soft side; it allocates.
    pub(crate) fn read_object(&mut self, object: Object) -> Result<Value, String> {
        let called = self.called(object.place)?;
        let (Some(mut master), Some(mailboxes)) = (self.master.take(), self.mailboxes.clone())
        else {
            return Err(format!("{called}: the bus is not in operation"));
        };
        let request = Request {
            object,
            value: None,
        };
        let value = master.run_beside(self, |main| mailboxes.ask(main, &called, &request));
        self.master = Some(master);
        value
    }

    /// Asks for an object while another exchanges: [`Bus::work`] goes on with it, and [`Bus::take_answer`] has what comes of it.
    /// Soft side; it allocates.
    pub(crate) fn ask(&mut self, request: &Request) -> Result<(), String> {
        let (called, request) = (self.called(request.object.place)?, *request);
        let index = request.object.index;
        if request.value.is_some() && OF_THE_DRIVER.contains(&index) {
            return Err(format!(
                "{called}: {index:04X} is the driver's own, which writes it in every period"
            ));
        }
        if self.job.is_some() {
            return Err(format!("{called}: another object is being asked for"));
        }
        let (Some(master), Some(mailboxes)) = (&self.master, self.mailboxes.clone()) else {
            return Err(format!("{called}: the bus is not in operation"));
        };
        let main = Arc::clone(&master.main);
        self.answer = None;
        self.job = Some(Box::pin(async move {
            mailboxes.ask(&main, &called, &request).await
        }));
        Ok(())
    }

    /// What came of the object that was asked for, once.
    pub(crate) fn take_answer(&mut self) -> Option<Result<Value, String>> {
        self.answer.take()
    }

    /// Whether an object is being asked for.
    pub(crate) fn is_asked(&self) -> bool {
        self.job.is_some()
    }

    /// Goes on with what is asked of an object, until so near the next exchange that no other frame would be back. Soft side, or
    /// virtual time; it allocates.
    fn work(&mut self, until_ns: u64) {
        let quiet_ns = (self.period_ns as f64 * QUIET_SHARE) as u64;
        let Some(mut job) = self.job.take() else {
            return;
        };
        let mut context = Context::from_waker(Waker::noop());
        loop {
            time::set(self.link.now_ns());
            if let Poll::Ready(answer) = job.as_mut().poll(&mut context) {
                self.answer = Some(answer);
                break;
            }
            let is_near = self.link.now_ns() + quiet_ns >= until_ns;
            let Some(master) = self.master.as_mut().filter(|_| !is_near) else {
                self.job = Some(job);
                break;
            };
            master.turn(&mut self.link, until_ns);
        }
    }

    /// The same on the wall clock, where the next exchange is due a period behind the last one. Nothing while its reply is on its
    /// way.
    pub(crate) fn work_beside(&mut self) {
        if !self.sent {
            self.work(self.begun_ns + self.period_ns);
        }
    }

    /// Where other processes ask for objects; none where the bus is emulated.
    pub(crate) fn server(&self) -> Option<ObjectServer> {
        self.link.lock().and_then(ObjectServer::at)
    }

    /// How every device is, for people who watch.
    pub(crate) fn watch(&self) -> Vec<Seen<'_>> {
        let members = self.members.iter();
        let seen = members.map(|member| Seen {
            called: &member.ready.called,
            al: member.al,
            al_code: member.al_code,
            status: member.ready.drive.as_ref().map(Drive::status),
            lost: member.lost,
        });
        seen.collect()
    }

    /// How far the last exchange was from its phase, ns.
    pub(crate) fn phase_ns(&self) -> Option<i64> {
        self.phase_ns
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        self.stop();
        if let Some(master) = self.master.take() {
            master.give_back();
        }
    }
}

/// Puts a latch to one of the same edge, or behind those that are there.
fn merge(latches: &mut [tandem_sdk::Latch], count: usize, latch: tandem_sdk::Latch) -> usize {
    let same = latches[..count]
        .iter_mut()
        .find(|other| other.input == latch.input && other.edge == latch.edge);
    if let Some(other) = same {
        other.joints |= latch.joints;
        other.position += latch.position;
        return count;
    }
    match latches.get_mut(count) {
        Some(slot) => {
            *slot = latch;
            count + 1
        }
        None => count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_rig::Random;

    fn drive(n: usize) -> String {
        format!(
            "[[devices]]\nposition = {n}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{n}\"\ncounts_per_mm = 1000\n"
        )
    }

    /// Two minutes on a computer that wakes up to 100 µs late, with clocks that are off by up to 100 ppm: every SYNC0 finds a new
    /// setpoint, and the frame is where it is wanted but for the jitter.
    #[test]
    fn two_minutes_of_jitter_and_drift_leave_no_sync0_without_a_setpoint() {
        const JITTER_NS: f64 = 100_000.0;
        for seed in [1, 2] {
            let mut random = Random::new(seed);
            let drives: String = (0..3).map(drive).collect();
            let clocks: String = [100.0, -100.0, (random.unit() - 0.5) * 200.0]
                .map(|ppm| format!("[[emulated.devices]]\nkind = \"drive\"\ndrift_ppm = {ppm:?}\n"))
                .concat();
            let text = format!("interface = \"emulated\"\nsync = \"dc\"\n{drives}{clocks}");
            let options = <Options as tandem_sdk::PluginOptions>::read(&text).unwrap();
            let context = crate::survey::context_of(&options, 0.001, false);
            let mut bus = Bus::open(&options, &context).unwrap();
            bus.start().unwrap();
            let count = |bus: &mut Bus| -> Vec<_> {
                let wire = bus.link.wire_mut().unwrap();
                let counters = wire
                    .bus()
                    .devices()
                    .iter()
                    .map(tandem_ethercat_emulator::Device::counters);
                counters
                    .map(|c| (c.sync0, c.sync0_without_outputs))
                    .collect()
            };
            let before = count(&mut bus);
            let mut worst_ns = 0;
            for _ in 0..120_000 {
                let late_ns = random.unit() * JITTER_NS;
                bus.link.wait_until(bus.next_ns + late_ns as u64);
                bus.exchange_at_once(&Setpoint::default());
                bus.steer();
                worst_ns = worst_ns.max(bus.phase_ns.unwrap().abs());
            }
            for ((pulses, empty), (pulses_before, empty_before)) in
                count(&mut bus).into_iter().zip(before)
            {
                assert!(pulses - pulses_before > 119_900, "seed {seed}: {pulses}");
                assert_eq!(empty, empty_before, "seed {seed}");
            }
            assert!(
                worst_ns as f64 <= JITTER_NS + 10_000.0,
                "seed {seed}: {worst_ns} ns"
            );
            println!("seed {seed}: the frame was at most {worst_ns} ns from its phase");
        }
    }
}
