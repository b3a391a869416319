//! What decoding and encoding cost, on the traffic of recorded flights and next to the `mavlink` crate's reader.

use std::hint::black_box;
use std::io::Cursor;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA};
use gimbald::wire::{DatagramFrames, FrameBuffer, MavId, StreamDecoder};
use mavlink::MavlinkReader;
use mavlink::dialects::storm32::MavMessage;

/// Bytes per read of the stream, as a busy serial port or TCP connection delivers them.
const READ: usize = 4096;

fn decoding(criterion: &mut Criterion) {
    let frames = recorded_frames();
    let stream = frames.concat();
    let mut group = criterion.benchmark_group("per frame");
    group.throughput(Throughput::Elements(frames.len() as u64));
    group.bench_function("stream, with targets", |bencher| {
        bencher.iter(|| {
            let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
            for read in stream.chunks(READ) {
                decoder.push(Timestamp::ZERO, read);
                while let Some(frame) = decoder.next_frame() {
                    black_box((frame.source(), frame.target()));
                }
            }
        });
    });
    group.bench_function("datagrams, with targets", |bencher| {
        bencher.iter(|| {
            for datagram in &frames {
                let mut datagram = DatagramFrames::new(datagram);
                while let Some(frame) = datagram.next_frame() {
                    black_box((frame.source(), frame.target()));
                }
            }
        });
    });
    group.bench_function("the crate's reader, raw frames", |bencher| {
        bencher.iter(|| {
            let mut reader = MavlinkReader::new(Cursor::new(&stream[..]));
            while let Ok(message) = reader.read_any_raw_message::<MavMessage>() {
                black_box(message.sequence());
            }
        });
    });
    group.finish();
}

fn encoding(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("encode");
    let mut buffer = FrameBuffer::default();
    let manager = MavId::new(1, 191);
    group.bench_function("GIMBAL_DEVICE_SET_ATTITUDE", |bencher| {
        let setpoint = GIMBAL_DEVICE_SET_ATTITUDE_DATA {
            q: [0.892_399, 0.099_046, -0.369_644, 0.239_118],
            angular_velocity_x: f32::NAN,
            angular_velocity_y: f32::NAN,
            angular_velocity_z: f32::NAN,
            flags: 44,
            target_system: 1,
            target_component: 154,
        };
        bencher.iter(|| black_box(buffer.encode(manager, 7, black_box(&setpoint)).bytes().len()));
    });
    group.bench_function("GIMBAL_MANAGER_STATUS", |bencher| {
        let status = GIMBAL_MANAGER_STATUS_DATA {
            time_boot_ms: 1000,
            flags: 44,
            gimbal_device_id: 154,
            primary_control_sysid: 255,
            primary_control_compid: 190,
            secondary_control_sysid: 0,
            secondary_control_compid: 0,
        };
        bencher.iter(|| black_box(buffer.encode(manager, 1, black_box(&status)).bytes().len()));
    });
    group.finish();
}

/// The frames of all recordings, link after link.
fn recorded_frames() -> Vec<Vec<u8>> {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/captures");
    let mut frames = Vec::new();
    for recording in [
        "ap_gremsy_a/gimbal",
        "ap_gremsy_a/ground",
        "ap_none/ground",
        "ap_storm32/gimbal",
        "ap_storm32/ground",
        "px4_dev/gimbal",
        "px4_dev/ground",
        "px4_nodev/ground",
    ] {
        let path = captures.join(recording).with_extension("tlog");
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut rest = &bytes[..];
        while let Some((_, after)) = rest.split_first_chunk::<8>() {
            // The recordings hold MAVLink 2 only.
            let len = usize::from(after[1]) + if after[2] & 1 == 0 { 12 } else { 25 };
            frames.push(after[..len].to_vec());
            rest = &after[len..];
        }
    }
    frames
}

criterion_group!(benches, decoding, encoding);
criterion_main!(benches);
