//! Measures the fraction of a scene's color channels that are black from every training camera of a dataset:
//! a clamp at 0 stops their learning.
//!
//!     cargo bench --bench dead -- DATASET SCENE...
//!
//! `bench/train` gives the test PSNR of the same scenes.

use std::{path::PathBuf, process::ExitCode};

use clap::Parser;
use glint::{
    Result,
    data::{Dataset, DatasetOptions, Split, read_scene},
    reference::{Params, harmonics::color_of},
};

#[derive(Parser)]
struct Args {
    /// Whose training cameras look
    dataset: PathBuf,
    /// At each of these
    scenes: Vec<PathBuf>,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// Fractions of dead channels, and of Gaussians with three dead channels.
fn dead(params: &Params, eyes: &[glam::DVec3]) -> [f64; 2] {
    let (mut channels, mut whole) = (0, 0);
    for i in 0..params.count {
        let mut lit = [false; 3];
        for &eye in eyes {
            let color = color_of(params, i, params.sh_degree, (params.mean(i) - eye).normalize());
            (0..3).for_each(|c| lit[c] |= color[c] > 0.0);
        }
        channels += lit.iter().filter(|lit| !**lit).count();
        whole += usize::from(lit == [false; 3]);
    }
    let all = params.count.max(1) as f64;
    [channels as f64 / (3.0 * all), whole as f64 / all]
}

fn run(args: &Args) -> Result<()> {
    let dataset = Dataset::open(&args.dataset, &DatasetOptions::default())?;
    let eyes: Vec<_> = dataset.split(Split::Train).map(|(_, photo)| photo.camera.eye()).collect();
    println!("| scene | Gaussians | black channels | black Gaussians |\n|---|---|---|---|");
    for path in &args.scenes {
        let params = Params::from_scene(&read_scene(path)?)?;
        let [channels, whole] = dead(&params, &eyes).map(|share| 100.0 * share);
        println!("| {} | {} | {channels:.1} % | {whole:.1} % |", path.display(), params.count);
    }
    Ok(())
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
