//! Measures a device's peak rates: bytes and multiply-adds per second.

use serde::Serialize;

use super::{Bench, Row};
use crate::{
    error::Result,
    gpu::{Buffer, Location},
    reference,
    stages::{WORKGROUP, fma_rate},
};

/// Measured rates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Rates {
    /// Bytes per second, read and written, of a copy on the device.
    pub bytes: f64,
    /// Float32 multiply-adds per second.
    pub operations: f64,
}

/// Minimum duration of a measurement: a shorter one measures the launch (some µs) rather than the rate.
const LONG_ENOUGH: f64 = 2e-3;
/// Largest buffer to copy: exceeds every cache, and fits every device's limit for one buffer.
const MAX_COPY: usize = 128 << 20;
const FIRST_COPY: usize = 64 << 20;
/// Independent recurrences per thread: enough to hide the latency of one (4 to 5 cycles on GPUs and CPUs).
const CHAINS: u32 = 8;
/// Steps of a recurrence between two branches.
const DEPTH: u32 = 16;
const ROUNDS: u32 = 64;
const FIRST_THREADS: u32 = 1 << 14;
const MAX_THREADS: u32 = 1 << 24;
const FACTOR: f32 = 0.5;
const TERM: f32 = 1.0;

/// Measures both rates; the multiply-adds also become an ordinary row.
pub(super) fn measure(bench: &mut Bench<'_>) -> Result<()> {
    let context = bench.context;
    let largest = MAX_COPY.min(context.info().max_storage_bytes as usize);
    let mut bytes = FIRST_COPY.min(largest);
    bench.rates.bytes = loop {
        let from = Buffer::<u32>::zeroed(context, "copied", bytes / 4)?;
        let to = Buffer::<u32>::new(context, "copy", bytes / 4, Location::Device)?;
        let time = bench.time(|recorder| recorder.copy(&from, 0, &to, 0, bytes / 4))?.whole();
        if time >= LONG_ENOUGH || 2 * bytes > largest {
            break 2.0 * bytes as f64 / time;
        }
        bytes *= 2;
    };

    let stage =
        fma_rate::Stage::new(context, &fma_rate::Spec { workgroup_size: WORKGROUP, chains: CHAINS, depth: DEPTH })?;
    let mut count = FIRST_THREADS;
    loop {
        let chain_sums = Buffer::<f32>::zeroed(context, "chain sums", count as usize)?;
        let push = fma_rate::Push { count, rounds: ROUNDS, factor: FACTOR, term: TERM };
        let buffers = fma_rate::Buffers { chain_sums: &chain_sums };
        let times = bench.time(|recorder| stage.record(recorder, &buffers, &push, count))?;
        if times.whole() < LONG_ENOUGH && count < MAX_THREADS {
            count *= 2;
            continue;
        }
        let operations = f64::from(count) * f64::from(CHAINS * DEPTH * ROUNDS);
        bench.rates.operations = operations / times.whole();
        // Results repeat after 1024 threads.
        let got = chain_sums.download_range(0, 1024)?;
        let want = reference::fma_rate::fma_rate(1024, CHAINS, DEPTH * ROUNDS, f64::from(FACTOR), f64::from(TERM));
        bench.push(|perturb| {
            let mut row = Row::new("fma_rate", format!("{CHAINS} chains"), perturb);
            row.numbers(got.iter().copied().zip(want.iter().copied()));
            row.time = times.of("fma_rate");
            row
        });
        return Ok(());
    }
}
