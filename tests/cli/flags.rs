//! Options and seeds change the result; repeating a run does not.

use std::{collections::BTreeMap, fs};

use image::Rgba;

use super::{NAMES, Work, brief, run};

impl Work {
    /// The scene that a command makes with some options.
    fn made(&self, command: &str, options: &str) -> Vec<u8> {
        let arguments = format!("{command} -o made.ply --force {options}");
        let output = run::run(brief(&mut self.bare(&arguments)));
        assert!(output.status.success(), "glint {arguments}: {}", String::from_utf8_lossy(&output.stderr));
        fs::read(self.path("made.ply")).unwrap()
    }

    /// Checks that `command` gives the same scene twice, and another one with each of `options`; returns
    /// all of them, the first under the name "".
    fn changes<'a>(&self, command: &str, options: &[&'a str]) -> BTreeMap<&'a str, Vec<u8>> {
        let plain = self.made(command, "");
        assert!(self.made(command, "") == plain, "{command} makes another scene every time");
        let mut made: BTreeMap<_, _> = options.iter().map(|option| (*option, self.made(command, option))).collect();
        let idle: Vec<_> = made.iter().filter(|(_, scene)| **scene == plain).map(|(option, _)| option).collect();
        assert!(idle.is_empty(), "{command}: {idle:?} change nothing");
        made.insert("", plain);
        made
    }
}

/// A regression test: a seed that was not used for the order of photos, and an ignored background, passed all
/// tests. All sparse points are used here, so that the seed only affects the order.
#[test]
fn every_option_of_training_changes_the_scene() {
    let options = [
        "--seed 1",
        "--points 100",
        "--gaussians 250",
        "--strategy adc",
        "--strategy mcmc",
        "--background white",
        "--max-size 16",
        "--holdout none",
        "--compensate",
        "--exposure",
        "--halvings 1",
        "--precision half",
    ];
    let (work, train) = (Work::new(), "train data --iterations 20 --sh-degree 1");
    let made = work.changes(train, &options);
    assert!(work.made(train, "--test-every none") == made["--holdout none"]);
    // Before its first refinement adaptive control does nothing, but its steps are Adam's; MCMC also has
    // other initial opacities.
    let fixed = work.made(train, "--strategy fixed");
    assert!(made["--strategy adc"] != fixed && made["--strategy mcmc"] != fixed);
    assert!(made["--max-size 16"] != work.made(train, "--max-size 16 --reduce bicubic"));
}

#[test]
fn every_option_of_augmenting_changes_the_scene() {
    let work = Work::small();
    work.trained("train data --iterations 60 --sh-degree 1", "base.ply");
    let of_augs = [
        "--seed 1",
        "--pca-weights plain",
        "--cluster-failure smallest",
        "--bias-correction",
        "--centre-depth",
        "--shared-steps",
    ];
    // Without test photos nothing learns a second time, to be compared with.
    work.changes("enhance data --base base.ply --method augs --preset quick --holdout none", &of_augs);
    let of_pursuit = [
        "--seed 1",
        "--ratio 0.3",
        "--background white",
        "--depth-threshold 0.8",
        "--precision half",
        "--compensate",
        "--max-size 16",
    ];
    let made = work.changes("enhance data --base base.ply --holdout none", &of_pursuit);
    assert!(work.made("enhance data --base base.ply", "") != made[""]);
    for option in ["--preset paper", "--shared-steps", "--pca-weights plain", "--bias-correction"] {
        let said = ["--method augs", option.split(' ').next().unwrap()];
        work.refused(&format!("enhance data --base base.ply -o x.ply {option}"), &said);
    }
}

/// Partly transparent photos are evaluated as if taken in front of the background. Training shows other backgrounds, too. The color of a fully
/// transparent pixel does not matter.
#[test]
fn what_is_transparent_in_a_photo_has_the_background() {
    let work = Work::new();
    let fill = |work: &Work, hidden: Rgba<u8>| {
        for name in NAMES {
            let path = work.path("data/images").join(name);
            let mut photo = image::open(&path).unwrap().into_rgba8();
            photo.pixels_mut().step_by(3).for_each(|pixel| *pixel = hidden);
            photo.save(&path).unwrap();
        }
    };
    let (train, white) = ("train data --iterations 5 --sh-degree 0", "--background white");
    let psnr =
        |work: &Work, options: &str| work.json(&format!("eval base.ply data --json {options}"))["base"]["psnr"].clone();
    work.ok(&format!("{train} -o base.ply"));
    fill(&work, Rgba([9, 200, 90, 0]));
    let (scene, over_black, over_white) = (work.made(train, ""), psnr(&work, ""), psnr(&work, white));
    fill(&work, Rgba([70, 0, 1, 0]));
    assert!(work.made(train, "") == scene);
    fill(&work, Rgba([0, 0, 0, 255]));
    let opaque = work.made(train, "");
    assert!(opaque != scene);
    assert_eq!(psnr(&work, ""), over_black);
    // An alpha channel without a transparent pixel changes nothing.
    for path in NAMES.map(|name| work.path("data/images").join(name)) {
        image::open(&path).unwrap().into_rgb8().save(&path).unwrap();
    }
    assert!(work.made(train, "") == opaque);
    fill(&work, Rgba([255; 4]));
    assert_eq!(psnr(&work, white), over_white);
    assert_ne!(over_black, over_white);
}
