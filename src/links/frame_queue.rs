//! Whole frames that wait for room in the kernel.
//!
//! A stream takes any number of bytes at a time. A frame of which a part went out is always finished before anything
//! else, so that the other side never sees a torn one.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};

use crate::timestamp::Timestamp;

/// A bounded queue of frames towards a stream.
#[derive(Debug)]
pub struct FrameQueue {
    bytes: Vec<u8>,
    /// How many of `bytes` went out.
    written: usize,
    /// The length of each frame that did not go out completely.
    lengths: VecDeque<usize>,
    /// How many bytes of the first of them went out.
    begun: usize,
    limit: usize,
    stalled_since: Option<Timestamp>,
}

impl FrameQueue {
    /// Holds at most `limit` bytes.
    pub fn new(limit: usize) -> Self {
        Self { bytes: Vec::new(), written: 0, lengths: VecDeque::new(), begun: 0, limit, stalled_since: None }
    }

    /// Queues a frame; `false` when there is no room for the whole of it.
    #[must_use]
    pub fn push(&mut self, frame: &[u8]) -> bool {
        if self.bytes.len() - self.written + frame.len() > self.limit {
            return false;
        }
        if self.bytes.len() + frame.len() > self.limit {
            self.bytes.drain(..self.written);
            self.written = 0;
        }
        self.bytes.extend_from_slice(frame);
        self.lengths.push_back(frame.len());
        true
    }

    pub fn is_empty(&self) -> bool {
        self.lengths.is_empty()
    }

    /// How many frames did not go out completely.
    pub fn frames(&self) -> u32 {
        self.lengths.len() as u32
    }

    /// Since when the kernel takes nothing, although there are frames.
    pub fn stalled_since(&self) -> Option<Timestamp> {
        self.stalled_since
    }

    /// Hands the frames to `write` until there are none or it takes no more; `WouldBlock` is no error here.
    pub fn write(&mut self, now: Timestamp, mut write: impl FnMut(&[u8]) -> io::Result<usize>) -> io::Result<()> {
        while self.written < self.bytes.len() {
            match write(&self.bytes[self.written..]) {
                Ok(count) if count > 0 => self.went_out(count),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() != ErrorKind::WouldBlock => return Err(error),
                _ => {
                    self.stalled_since.get_or_insert(now);
                    return Ok(());
                }
            }
        }
        self.bytes.clear();
        self.written = 0;
        Ok(())
    }

    fn went_out(&mut self, count: usize) {
        self.written += count;
        self.stalled_since = None;
        self.begun += count;
        while let Some(first) = self.lengths.front().copied().filter(|first| *first <= self.begun) {
            self.begun -= first;
            self.lengths.pop_front();
        }
    }

    /// Drops the frames of which nothing went out yet, and says how many they were.
    pub fn drop_unbegun(&mut self) -> u32 {
        let kept = usize::from(self.begun > 0);
        let dropped = self.lengths.len().saturating_sub(kept);
        self.lengths.truncate(kept);
        let rest = self.lengths.front().map_or(0, |first| first - self.begun);
        self.bytes.truncate(self.written + rest);
        if self.lengths.is_empty() {
            self.stalled_since = None;
        }
        dropped as u32
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NOW: Timestamp = Timestamp::from_secs(1);

    /// Takes at most `room` bytes.
    fn kernel(room: usize, line: &mut Vec<u8>) -> impl FnMut(&[u8]) -> io::Result<usize> {
        let mut room = room;
        move |bytes| {
            let count = bytes.len().min(room);
            if count == 0 {
                return Err(ErrorKind::WouldBlock.into());
            }
            room -= count;
            line.extend_from_slice(&bytes[..count]);
            Ok(count)
        }
    }

    #[test]
    fn a_begun_frame_is_finished_and_the_others_may_be_dropped() {
        let mut line = Vec::new();
        let mut queue = FrameQueue::new(100);
        assert!(queue.push(b"first") && queue.push(b"second") && queue.push(b"third"));

        queue.write(NOW, kernel(7, &mut line)).expect("a full kernel is no error");
        queue.write(NOW + std::time::Duration::from_secs(1), kernel(0, &mut line)).expect("nor is a stalled one");
        assert_eq!(queue.stalled_since(), Some(NOW));
        assert_eq!(queue.drop_unbegun(), 1);
        assert_eq!(queue.frames(), 1);
        queue.write(NOW, kernel(100, &mut line)).expect("no error");

        assert_eq!(line, b"firstsecond");
        assert!(queue.is_empty());
        assert_eq!(queue.stalled_since(), None);
    }

    #[test]
    fn nothing_begun_means_that_all_may_be_dropped() {
        let mut line = Vec::new();
        let mut queue = FrameQueue::new(100);
        assert!(queue.push(b"first") && queue.push(b"second"));

        queue.write(NOW, kernel(5, &mut line)).expect("no error");

        assert_eq!(queue.drop_unbegun(), 1);
        assert!(queue.is_empty());
        assert_eq!(queue.stalled_since(), None);
    }

    #[test]
    fn a_frame_that_does_not_fit_is_refused_whole() {
        let mut line = Vec::new();
        let mut queue = FrameQueue::new(10);
        assert!(queue.push(&[1; 6]));
        assert!(!queue.push(&[2; 5]));

        queue.write(NOW, kernel(3, &mut line)).expect("no error");
        assert!(queue.push(&[3; 7]));
        queue.write(NOW, kernel(100, &mut line)).expect("no error");

        assert_eq!(line, [[1; 6].as_slice(), &[3; 7]].concat());
    }

    #[test]
    fn an_error_is_handed_on() {
        let mut queue = FrameQueue::new(10);
        assert!(queue.push(&[1; 6]));
        let error = queue.write(NOW, |_| Err(ErrorKind::BrokenPipe.into())).expect_err("the pipe is broken");
        assert_eq!(error.kind(), ErrorKind::BrokenPipe);
    }

    proptest! {
        /// "whole frames only": whatever the kernel takes, the line carries accepted frames, in order, unbroken.
        #[test]
        fn the_line_carries_whole_frames(
            steps in prop::collection::vec((1..60usize, 0..80usize, any::<bool>()), 1..100)
        ) {
            let mut line = Vec::new();
            let mut queue = FrameQueue::new(128);
            for (number, (length, room, drop)) in steps.into_iter().enumerate() {
                let frame: Vec<u8> = [length as u8].into_iter().chain((1..length).map(|_| number as u8)).collect();
                let fits = queue.push(&frame);
                queue.write(NOW, kernel(room, &mut line)).expect("no error");
                if drop || !fits {
                    queue.drop_unbegun();
                }
            }
            queue.write(NOW, kernel(1_000, &mut line)).expect("no error");

            let mut rest = &line[..];
            while let Some(&length) = rest.first() {
                let (frame, behind) = rest.split_at_checked(usize::from(length)).expect("the last frame is whole");
                prop_assert!(frame[1..].windows(2).all(|pair| pair[0] == pair[1]));
                rest = behind;
            }
            prop_assert!(queue.is_empty());
        }
    }
}
