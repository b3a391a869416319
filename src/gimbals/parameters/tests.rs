mod any_gimbal;
mod reading;

use std::time::Duration;

use super::*;
use crate::sim::outbox::Outbox;
use crate::sim::parameters::{IntegerEncoding, ParameterServer, ParameterValue};
use crate::sim::random::Random;
use crate::wire::dialect::PARAM_REQUEST_READ_DATA;
use crate::wire::{DatagramFrames, FrameBuffer, encode_to_vec};

const MANAGER: MavId = MavId::new(1, 191);
const GIMBAL: MavId = MavId::new(1, 154);
const GCS: MavId = MavId::new(255, 190);
const ID: OperationId = OperationId(7);

const NAMES: [&str; 3] = ["ALPHA", "BETA", "GAMMA"];

fn catalogue(_has: &dyn Fn(&str) -> bool) -> Vec<Known> {
    NAMES.iter().zip(0..).map(|(name, index)| Known { name, index: Some(index) }).collect()
}

/// The machine and a gimbal on a line, in simulated time.
struct Line {
    now: Timestamp,
    parameters: Parameters,
    gimbal: ParameterServer,
    outbox: Outbox,
    /// Which requests are lost, by number.
    lost: fn(usize, &MavMessage) -> bool,
    /// This share of what is sent is lost besides, either way.
    loss: Option<(f64, Random)>,
    sent: Vec<(u64, MavMessage)>,
    done: Vec<(u64, ParameterOutput)>,
}

impl Line {
    /// A gimbal that has these of the names, 10, 11 and 12.
    fn new(names: &[&'static str]) -> Self {
        let list = names.iter().map(|name| {
            let at = NAMES.iter().position(|known| known == name).expect("one of them");
            (*name, ParameterValue::Integer(10 + at as i32))
        });
        let gimbal = ParameterServer::new(list.collect(), IntegerEncoding::CCast);
        Self::with(Parameters::new(Encoding::Int16AsNumber, catalogue), gimbal)
    }

    fn with(parameters: Parameters, gimbal: ParameterServer) -> Self {
        Self {
            now: Timestamp::ZERO,
            parameters,
            gimbal,
            outbox: Outbox::new(GIMBAL),
            lost: |_, _| false,
            loss: None,
            sent: Vec::new(),
            done: Vec::new(),
        }
    }

    fn settled(names: &[&'static str]) -> Self {
        let mut line = Self::new(names);
        line.parameters.refresh(line.now, GIMBAL);
        line.run_for(20_000);
        assert!(line.parameters.is_settled());
        line.sent.clear();
        line.done.clear();
        line
    }

    fn settle(&mut self) {
        loop {
            let mut busy = false;
            while let Some(output) = self.parameters.poll_output() {
                busy = true;
                match output {
                    ParameterOutput::Send(message) => {
                        let number = self.sent.len();
                        self.sent.push((self.now.as_micros() / 1_000, (*message).clone()));
                        let bytes = FrameBuffer::default().encode_any(MANAGER, 0, &message).bytes().to_vec();
                        if !(self.lost)(number, &message) && !self.is_lost() {
                            self.tell_gimbal(&bytes);
                        }
                    }
                    output => self.done.push((self.now.as_micros() / 1_000, output)),
                }
            }
            while let Some(bytes) = self.outbox.poll() {
                busy = true;
                if !self.is_lost() {
                    self.hear(&bytes);
                }
            }
            if !busy {
                return;
            }
        }
    }

    fn is_lost(&mut self) -> bool {
        self.loss.as_mut().is_some_and(|(share, random)| random.unit() < *share)
    }

    /// Somebody sends that on the line.
    fn hear(&mut self, bytes: &[u8]) {
        let frame = DatagramFrames::new(bytes).next_frame().expect("a frame");
        self.parameters.handle_received(self.now, &frame);
    }

    fn tell_gimbal(&mut self, bytes: &[u8]) {
        let frame = DatagramFrames::new(bytes).next_frame().expect("a frame");
        self.gimbal.handle_frame(self.now, &frame, &mut self.outbox);
    }

    /// Somebody sets one, and what the gimbal says to that is lost.
    fn change_unheard(&mut self, name: &str, value: f32) {
        let set = PARAM_SET_DATA {
            param_value: value,
            target_system: 1,
            target_component: 154,
            param_id: CharArray::from(name),
            param_type: 4,
        };
        self.tell_gimbal(&encode_to_vec(GCS, 0, &set));
        assert!(self.outbox.poll().is_some() && self.outbox.poll().is_none(), "it is told back");
    }

    fn run_for(&mut self, millis: u64) {
        let end = self.now + Duration::from_millis(millis);
        self.settle();
        loop {
            let next = [self.parameters.poll_timeout(), self.gimbal.poll_timeout()].into_iter().flatten().min();
            let Some(next) = next.filter(|next| *next <= end) else { break };
            self.now = next.max(self.now);
            self.gimbal.handle_timeout(self.now, &mut self.outbox);
            self.parameters.handle_timeout(self.now);
            self.settle();
        }
        self.now = end;
    }

    /// What was read, and when.
    fn reads(&self) -> Vec<(u64, String, i16)> {
        let read = |(at, message): &(u64, MavMessage)| match message {
            MavMessage::PARAM_REQUEST_READ(read) => {
                Some((*at, read.param_id.to_str().expect("a name").to_owned(), read.param_index))
            }
            _ => None,
        };
        self.sent.iter().filter_map(read).collect()
    }

    fn sets(&self) -> Vec<(u64, f32, u8)> {
        let set = |(at, message): &(u64, MavMessage)| match message {
            MavMessage::PARAM_SET(set) => Some((*at, set.param_value, set.param_type)),
            _ => None,
        };
        self.sent.iter().filter_map(set).collect()
    }
}

fn is_list(message: &MavMessage) -> bool {
    matches!(message, MavMessage::PARAM_REQUEST_LIST(_))
}

/// Gimbal statement 13: "PARAM_SET writes an int16 number as its float value with param_type 4; the golden PARAM_SET frame
/// matches."
#[test]
fn statement_13_the_golden_frame_of_a_set() {
    let mut line = Line::settled(&NAMES);

    line.parameters.set(line.now, ID, &[("RC_LIM_MAX_TILT", 45.0)]);
    line.settle();

    let frame = FrameBuffer::default().encode_any(MANAGER, 9, &line.sent[0].1).bytes().to_vec();
    let golden =
        "FD 17 00 00 09 01 BF 17 00 00 00 00 34 42 01 9A 52 43 5F 4C 49 4D 5F 4D 41 58 5F 54 49 4C 54 00 04 6A A1";
    let bytes: Vec<u8> = golden.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect();
    assert_eq!(frame, bytes);
}

/// Gimbal statement 14: "A PARAM_SET lost on the wire is re-sent (not only re-read) and the final value is correct."
#[test]
fn statement_14_a_lost_set_is_sent_again() {
    let mut line = Line::settled(&NAMES);
    line.lost = |number, _| number < 2;

    line.parameters.set(line.now, ID, &[("BETA", 99.0)]);
    line.run_for(5_000);

    let start = 20_000;
    assert_eq!(line.sets(), [(start, 99.0, 4), (start + 300, 99.0, 4), (start + 600, 99.0, 4)]);
    assert_eq!(line.sent.len(), 3, "nothing else is sent");
    assert_eq!(line.done, [(start + 600, ParameterOutput::Done { id: ID, result: Ok(()) })]);
    assert_eq!(line.gimbal.value("BETA"), Some(ParameterValue::Integer(99)));
    assert_eq!(line.parameters.value("BETA"), Some(99.0));
}

/// "set → expect PARAM_VALUE echo 300 ms → resend, 5 tries" (gimbals 1.6).
#[test]
fn a_set_that_is_never_answered_ends_after_five() {
    let mut line = Line::settled(&NAMES);
    line.lost = |_, _| true;

    line.parameters.set(line.now, ID, &[("ALPHA", 1.0), ("BETA", 2.0)]);
    line.parameters.set(line.now, OperationId(8), &[("GAMMA", 3.0)]);
    line.run_for(5_000);

    assert_eq!(line.sets().len(), 10, "the second of a request that failed is not sent");
    let failed = |id| ParameterOutput::Done { id, result: Err(OperationError::NoAnswer) };
    assert_eq!(line.done, [(21_500, failed(ID)), (23_000, failed(OperationId(8)))]);
}

/// "out-of-range value → echo of the old value" (gimbals 5.3) is a refusal.
#[test]
fn a_value_that_the_gimbal_does_not_take_is_refused() {
    let mut line = Line::settled(&NAMES);
    line.lost = |_, _| true;

    line.parameters.set(line.now, ID, &[("ALPHA", 500.0)]);
    for _ in 0..2 {
        line.settle();
        line.tell_gimbal(&read_by_ground_station());
        line.run_for(300);
    }

    let result = Err(OperationError::NoEffect("ALPHA is 10".to_owned()));
    assert_eq!(line.done, [(20_600, ParameterOutput::Done { id: ID, result })]);
}

/// One answer to somebody else, with the value as it was, is no refusal.
#[test]
fn an_answer_to_somebody_else_is_no_refusal() {
    let mut line = Line::settled(&NAMES);
    line.lost = |number, _| number == 0;

    line.parameters.set(line.now, ID, &[("ALPHA", 5.0)]);
    line.settle();
    line.tell_gimbal(&read_by_ground_station());
    line.run_for(1_000);

    assert_eq!(line.done, [(20_300, ParameterOutput::Done { id: ID, result: Ok(()) })]);
}

/// "Echoes to others update the cache"; nothing is sent for it, and foreign components are not believed.
#[test]
fn what_others_set_is_known() {
    let mut line = Line::settled(&NAMES);
    let value = PARAM_VALUE_DATA {
        param_value: -3.0,
        param_count: 3,
        param_index: 1,
        param_id: CharArray::from("BETA"),
        param_type: 4,
    };
    for (source, expected) in [(MavId::new(1, 1), 11.0), (MavId::new(2, 154), 11.0), (GIMBAL, -3.0)] {
        let bytes = encode_to_vec(source, 0, &value);
        let frame = DatagramFrames::new(&bytes).next_frame().expect("a frame");
        line.parameters.handle_received(line.now, &frame);
        assert_eq!(line.parameters.value("BETA"), Some(expected), "{source}");
    }
    line.run_for(5_000);
    assert!(line.sent.is_empty() && line.done.is_empty());
}

#[test]
fn what_cannot_be_set_is_refused_at_once() {
    let mut line = Line::settled(&NAMES);
    let mut refused = |values: &[(&str, f64)]| {
        line.parameters.set(line.now, ID, values);
        line.settle();
        assert!(line.sent.is_empty());
        match line.done.pop() {
            Some((_, ParameterOutput::Done { result: Err(error), .. })) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(&[("ALPHA", 0.5)]), "0.5 is no whole number from -32768 to 32767");
    assert_eq!(
        refused(&[("SEVENTEEN_LETTERS", 1.0)]),
        "the name of a parameter has 1 to 16 ASCII characters without blanks"
    );
    assert_eq!(refused(&[("ALPHA", 1.0); 65]), "the gimbal is busy with what was asked of it before. Try again");
    line.parameters.forget();
    line.parameters.set(line.now, ID, &[("ALPHA", 1.0)]);
    line.settle();
    assert_eq!(
        line.done.pop().map(|(_, done)| done),
        Some(ParameterOutput::Done { id: ID, result: Err(OperationError::NotThere) })
    );
}

/// A gimbal that is gone answers nothing any more: whoever waits is told.
#[test]
fn what_was_asked_of_a_gimbal_that_is_gone_is_not_done() {
    let mut line = Line::settled(&NAMES);
    line.lost = |_, _| true;
    line.parameters.set(line.now, ID, &[("ALPHA", 1.0), ("BETA", 1.0)]);
    line.parameters.refresh_for(line.now, OperationId(8));

    line.parameters.forget();
    line.run_for(5_000);

    let gone = |id| (20_000, ParameterOutput::Done { id, result: Err(OperationError::NotThere) });
    assert_eq!(line.done, [gone(ID), gone(OperationId(8))]);
    assert_eq!(line.parameters.poll_timeout(), None);
}

/// What is known is of the device that told it: of the next one nothing is known, and what was asked of the first is not done.
#[test]
fn nothing_is_known_of_another_device() {
    let mut line = Line::settled(&NAMES);
    line.lost = |_, _| true;
    line.parameters.set(line.now, ID, &[("ALPHA", 1.0)]);
    line.parameters.listen(GIMBAL);
    line.settle();
    assert_eq!((line.parameters.values().count(), line.done.len()), (3, 0), "it is the same one");

    line.parameters.listen(MavId::new(1, 171));
    line.run_for(5_000);

    assert_eq!(line.parameters.values().count(), 0);
    assert_eq!(line.done, [(20_000, ParameterOutput::Done { id: ID, result: Err(OperationError::NotThere) })]);
    assert_eq!(line.sent.len(), 1, "{:?}", line.sent);
}

fn read_by_ground_station() -> Vec<u8> {
    encode_to_vec(
        GCS,
        0,
        &PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: 1,
            target_component: 154,
            param_id: CharArray::from("ALPHA"),
        },
    )
}
