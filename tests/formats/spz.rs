//! Tests SPZ, all versions.

use std::io::{Read, Write};

use super::*;

/// A stream of one Gaussian of degree 1 in versions 1 to 3, built from the format's description.
fn legacy(version: u32, count: u32) -> Vec<u8> {
    let mut out = b"NGSP".to_vec();
    out.extend(version.to_le_bytes());
    out.extend(count.to_le_bytes());
    // SH degree 1, 12 fractional bits, no flags.
    out.extend([1, 12, 0, 0]);
    match version {
        // 1.5, −2 and 0.25 as float16.
        1 => out.extend([0x00, 0x3e, 0x00, 0xc0, 0x00, 0x34]),
        // The same times 4,096, in 24 bits.
        _ => out.extend([0x00, 0x18, 0x00, 0x00, 0xe0, 0xff, 0x00, 0x04, 0x00]),
    }
    out.push(51);
    out.extend([0, 255, 128]);
    out.extend([160, 176, 0]);
    match version {
        // x = 1, y and z nearly 0, so that nothing is left for w.
        1 | 2 => out.extend([255, 127, 128]),
        // The largest is x (index 0); y = −0.5, z = 0.25, w = 0.5 of 511 √2.
        _ => {
            let magnitude = |v: f64| (511.0 * 2f64.sqrt() * v).round() as u32;
            let [y, z, w] = [512 | magnitude(0.5), magnitude(0.25), magnitude(0.5)];
            out.extend((y << 20 | z << 10 | w).to_le_bytes());
        }
    }
    // The bands −1 (y), 0 (z), 1 (x).
    out.extend([128 + 64, 128 - 32, 0, 255, 128, 129, 192, 64, 128]);
    out
}

fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn versions_1_to_3_are_read_as_described_and_turned_to_the_frame_of_ply() {
    for version in 1..=3 {
        for name in ["one.spz", "one.gz"] {
            let base = read(name, &zipped(&legacy(version, 1))).unwrap().scene.base;
            assert_eq!((base.len(), base.sh_degree), (1, 1));
            // y up and z back become y down and z front.
            assert_eq!(base.means, [[1.5, 2.0, -0.25]], "version {version}");
            assert_eq!(base.log_scales, [[0.0, 1.0, -10.0]]);
            assert!((opacity(&base, 0)[0] - 0.2).abs() < ROUNDING);
            let dc = [-0.5 / 0.15, 0.5 / 0.15, (128.0 / 255.0 - 0.5) / 0.15];
            assert!(vector(base.sh[0]).iter().zip(dc).all(|(a, b)| (a - b).abs() < ROUNDING));
            // Harmonics odd in y or z change sign.
            assert_eq!(base.sh[1..], [[-0.5, 0.25, 1.0], [-127.0 / 128.0, 0.0, -1.0 / 128.0], [0.5, -0.5, 0.0]]);
            let [w, x, y, z] = base.quats[0];
            if version == 3 {
                let largest = (1.0f32 - 0.25 - 0.0625 - 0.25).sqrt();
                // Half a step of 1 / (511 √2).
                let near = |a: f32, b: f32| (a - b).abs() < 0.0015;
                assert!(near(w, 0.5) && near(x, largest) && near(y, 0.5) && near(z, -0.25), "{:?}", base.quats[0]);
            } else {
                assert!(w.abs() < 0.01 && x == 1.0 && y.abs() < 0.01 && z.abs() < 0.01, "{:?}", base.quats[0]);
            }
        }
    }
}

/// The contents of [`legacy`], in PLY's frame.
fn one() -> Scene {
    let base = Gaussians {
        sh_degree: 1,
        means: vec![[1.5, 2.0, -0.25]],
        log_scales: vec![[0.0, 1.0, -10.0]],
        quats: vec![[0.0, 2.0, 0.0, 0.0]],
        opacities: vec![-(4f32.ln())],
        sh: vec![[-0.5 / 0.15, 0.5 / 0.15, 0.0], [-0.5, 0.25, 1.0], [0.0; 3], [0.5, -0.5, 0.0]],
    };
    Scene { base, ..Default::default() }
}

fn written(scene: &Scene, version: u8) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.spz");
    write_scene_as(&path, super::spz(version), &scene.clone().into()).map_err(|error| error.to_string())?;
    Ok(fs::read(path).unwrap())
}

#[test]
fn versions_1_to_3_are_written_as_described() {
    for version in 1..=3 {
        let mut stream = Vec::new();
        flate2::read::GzDecoder::new(&written(&one(), version).unwrap()[..]).read_to_end(&mut stream).unwrap();
        let mut expected = legacy(version.into(), 1);
        // The stream's number of fraction bits is kept, except in version 1.
        expected[13] = stream[13];
        let at = if version == 1 { 22 } else { 25 };
        if version > 1 {
            let one = 1 << stream[13];
            let fixed = stream[16..25].chunks_exact(3).map(|b| i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8);
            assert_eq!(fixed.collect::<Vec<i32>>(), [one + one / 2, -2 * one, one / 4]);
            expected.splice(16..25, stream[16..25].iter().copied());
        }
        // 0.5 as a color's byte, a rotation about x alone, and a band of zeros: the written bytes differ
        // from the original ones.
        let turn = if version < 3 { vec![255, 128, 128] } else { vec![0; 4] };
        let harmonics = at + 7 + turn.len();
        expected.splice(at + 7..harmonics, turn);
        expected.splice(harmonics..harmonics + 9, [192, 96, 0, 128, 128, 128, 192, 64, 128]);
        assert_eq!(stream, expected, "version {version}");
    }
    for version in [0, 5] {
        assert!(written(&one(), version).unwrap_err().contains("expected 1 to 4"));
    }
}

#[test]
fn older_versions_come_back_within_half_a_step_and_3_as_4_does() {
    let scene = sample(11, 400, 2);
    let back = |version| read("old.spz", &written(&scene, version).unwrap()).unwrap().scene.base;
    let [first, second, third, fourth] = [1, 2, 3, 4].map(back);
    assert_eq!(third, fourth);
    assert_eq!((&second.means, &second.opacities, &second.sh), (&fourth.means, &fourth.opacities, &fourth.sh));
    assert_eq!((&first.quats, &first.sh), (&second.quats, &second.sh));
    for (i, mean) in scene.base.means.iter().enumerate() {
        for (&before, &after) in mean.iter().zip(&first.means[i]) {
            // 11 bits of float16, whose smallest normal number is 2⁻¹⁴.
            let step = f64::from(before).abs().max(2f64.powi(-14)) * 2f64.powi(-10);
            assert!((f64::from(after) - f64::from(before)).abs() <= 0.5 * step + ROUNDING);
        }
        // Half a step of 1 / 127.5 in each of x, y and z, δ; the error of w is at most the root of the error
        // of its square, 2 |δ| + |δ|².
        let [a, b] = [scene.base.quats[i], second.quats[i]].map(|quat| {
            let length = quat.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
            quat.map(|v| f64::from(v) / length * f64::from(quat[0].signum()))
        });
        let off = (0..3).map(|axis| (a[axis + 1] - b[axis + 1]).abs()).fold(0.0, f64::max);
        let delta = 0.5 * 3f64.sqrt() / 127.5;
        // If w was lost, the other three are too long in total, by at most |δ|.
        let lost = if second.quats[i][0] == 0.0 { delta } else { 0.0 };
        assert!(off <= 0.5 / 127.5 + lost + ROUNDING, "{off}");
        assert!((a[0] - b[0]).abs() <= (2.0 * delta + delta * delta).sqrt() + ROUNDING, "{a:?} {b:?}");
    }
    let mut far = sample(2, 3, 0);
    far.base.means[0] = [70_000.0, 0.0, 0.0];
    assert!(written(&far, 1).unwrap_err().contains("version 1 holds, ±65504"));
    assert!(written(&far, 2).is_ok());
}

#[test]
fn version_4_is_written_as_described() {
    let (_, bytes) = round_trip(&one(), "spz");
    assert_eq!(bytes[..16], [b'N', b'G', b'S', b'P', 4, 0, 0, 0, 1, 0, 0, 0, 1, bytes[13], 0, 6]);
    assert_eq!(bytes[16..32], [32, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let mut at = 32 + 6 * 16;
    let mut streams = Vec::new();
    for row in bytes[32..at].chunks_exact(16) {
        let [packed, whole] = [0, 8].map(|i| u64::from_le_bytes(row[i..i + 8].try_into().unwrap()) as usize);
        streams.push(zstd::bulk::decompress(&bytes[at..at + packed], whole).unwrap());
        assert_eq!(streams.last().unwrap().len(), whole);
        at += packed;
    }
    assert_eq!(at, bytes.len());
    let one = 1 << bytes[13];
    let fixed: Vec<i32> = streams[0].chunks_exact(3).map(|b| i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8).collect();
    assert_eq!(fixed, [one + one / 2, -2 * one, one / 4]);
    assert_eq!(streams[1..4], [vec![51], vec![0, 255, 128], vec![160, 176, 0]]);
    assert_eq!(streams[4], [0, 0, 0, 0]);
    assert_eq!(streams[5], [192, 96, 0, 128, 128, 128, 192, 64, 128]);
}

#[test]
fn what_is_written_comes_back_within_half_a_step() {
    for degree in 0..=3 {
        let scene = sample(11, 400, degree);
        let (back, bytes) = round_trip(&scene, "spz");
        let (a, b) = (&scene.base, &back.base);
        assert_eq!(b.sh_degree, degree);
        let step = (-f64::from(bytes[13])).exp2();
        let farthest = a.means.iter().flatten().fold(0f32, |most, v| most.max(v.abs()));
        assert!(step * 8_388_608.0 < 4.0 * f64::from(farthest), "{step}: a bit was left unused");
        assert!(largest(a, b, means) <= 0.5 * step + ROUNDING);
        let sizes =
            |g: &Gaussians, i: usize| log_scales(g, i).iter().map(|v| v.clamp(-10.0, 255.0 / 16.0 - 10.0)).collect();
        assert!(largest(a, b, sizes) <= 0.5 / 16.0 + ROUNDING);
        // Within the range of a color's byte.
        assert!(largest(a, b, harmonics(0)) <= 0.5 / 255.0 / 0.15 + ROUNDING);
        for band in 1..=degree as usize {
            let held =
                |g: &Gaussians, i: usize| harmonics(band)(g, i).iter().map(|v| v.clamp(-1.0, 127.0 / 128.0)).collect();
            assert!(largest(a, b, held) <= 0.5 / 128.0 + ROUNDING, "band {band}");
        }
    }
}

#[test]
fn far_scenes_have_fewer_bits_and_too_far_ones_are_refused() {
    let mut scene = sample(2, 3, 0);
    scene.base.means = vec![[8e6, -8e6, 0.0], [1.0, 2.0, 3.0], [-1.0, 0.5, 0.25]];
    let (back, bytes) = round_trip(&scene, "spz");
    assert_eq!((bytes[13], back.base.means[0], back.base.means[1]), (0, [8e6, -8e6, 0.0], [1.0, 2.0, 3.0]));
    scene.base.means[0][1] = -9e6;
    let folder = tempfile::tempdir().unwrap();
    let error = write_scene_file(folder.path().join("far.spz"), &scene.into()).unwrap_err().to_string();
    assert!(error.contains("far.spz") && error.contains("9e6") && error.contains("±8388607"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_flag_for_antialiasing_is_kept() {
    // An unset flag may come from a program that does not know it; glint's own record in version 4 tells more.
    for (antialiased, told) in [(None, None), (Some(false), None), (Some(true), Some(true))] {
        let trained_with = TrainedWith { antialiased, ..Default::default() };
        for (version, told) in [(3, told), (4, antialiased)] {
            let file = SceneFile { trained_with, ..SceneFile::from(sample(1, 2, 0)) };
            assert_eq!(kept(&file, super::spz(version)).0.trained_with.antialiased, told);
        }
    }
    let mut stream = legacy(2, 1);
    stream[14] = 1;
    assert_eq!(read("b.spz", &zipped(&stream)).unwrap().trained_with.antialiased, Some(true));
}

/// A file of version 4 with these bytes between header and table.
fn with_extensions(bytes: &[u8], records: &[u8]) -> Vec<u8> {
    let mut out = bytes[..32].to_vec();
    out[14] |= 2;
    out[16..20].copy_from_slice(&(32 + records.len() as u32).to_le_bytes());
    [&out, records, &bytes[32..]].concat()
}

#[test]
fn extensions_are_skipped_but_for_that_of_the_frame() {
    let (plain, bytes) = round_trip(&sample(9, 3, 1), "spz");
    let record =
        |kind: u32, payload: &[u8]| [&kind.to_le_bytes()[..], &(payload.len() as u32).to_le_bytes(), payload].concat();
    let unknown = record(0x1234_0001, &[7; 12]);
    assert_eq!(read("a.spz", &with_extensions(&bytes, &unknown)).unwrap().scene, plain);
    // 6 is x right, y down, z front, PLY's own frame: the file's numbers stay unchanged.
    let frame = |system: u32| [unknown.clone(), record(0xADBE_0003, &system.to_le_bytes())].concat();
    let turned = read("a.spz", &with_extensions(&bytes, &frame(6))).unwrap().scene.base;
    let [x, y, z] = plain.base.means[0];
    assert_eq!(turned.means[0], [x, -y, -z]);
    assert_eq!(turned.sh[1], plain.base.sh[1].map(|v| -v));
    assert_eq!(read("a.spz", &with_extensions(&bytes, &frame(4))).unwrap().scene, plain);
    refused("a.spz", &with_extensions(&bytes, &frame(9)), &["0xadbe0003", "expected 0 to 8"]);
    let long = [&0x1234_0001u32.to_le_bytes()[..], &100u32.to_le_bytes(), &[0; 3]].concat();
    refused("a.spz", &with_extensions(&bytes, &long), &["extension 0x12340001 of 100 bytes", "3 are left"]);
    // Up to version 3 extensions come last.
    let mut legacy = legacy(3, 1);
    legacy[14] = 2;
    let wanted = read("b.spz", &zipped(&legacy)).unwrap().scene;
    legacy.extend(unknown);
    assert_eq!(read("b.spz", &zipped(&legacy)).unwrap().scene, wanted);
    legacy[14] = 0;
    refused("b.spz", &zipped(&legacy), &["more than the", "1 Gaussians"]);
}

/// Other readers show the base for them, because they skip the record. A direction has 15 bits a part, a width 16, a sharpness the 11 of
/// float16: half a step each, and float32's rounding. The smallest width has the next larger step, a whole step away.
#[test]
fn lobes_are_in_an_extension_that_other_readers_skip() {
    let mut file = faded(random_scene(7, 60, 20, 2));
    let lobes = &mut file.scene.supplement.as_mut().unwrap().lobes;
    (lobes.widths[0], lobes.widths[1]) = (0.01, 1.0);
    (lobes.sharpness[2], lobes.sharpness[3]) = (1e30, -1e30);
    let (scene, shown) = (&file.scene, file.shown.as_ref().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("augmented.spz");
    assert_eq!(write_scene_file(&path, &file).unwrap(), [""; 0]);
    let back = read_scene_file(&path).unwrap();
    let alone = |base: &Gaussians| round_trip(&Scene { base: base.clone(), ..Default::default() }, "spz").0.base;
    assert!(back.shown == Some(alone(shown)) && back.scene.base == alone(&scene.base));
    let (found, wanted) = (back.scene.supplement.unwrap(), scene.supplement.as_ref().unwrap());
    assert_eq!(found.gaussians, alone(&wanted.gaussians));
    for i in 0..20 {
        let [a, b] = [&found.lobes, &wanted.lobes].map(|lobes| lobes.directions[i].map(f64::from));
        let length = b.iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!((0..3).all(|k| (a[k] - b[k] / length).abs() < 0.51 / 32767.0), "{a:?} for {b:?}");
        let [a, b] = [&found.lobes, &wanted.lobes].map(|lobes| [lobes.widths[i], lobes.sharpness[i]].map(f64::from));
        let (off, sharpness) = (if b[0] > 0.01 { 0.51 } else { 1.0 } / 65535.0, b[1].clamp(-65504.0, 65504.0));
        assert!((a[0] - b[0]).abs() < off && (a[1] - sharpness).abs() <= sharpness.abs() / 2048.0, "{a:?} for {b:?}");
    }

    // The record begins behind the header: under another number it is one that a reader does not know.
    let bytes = fs::read(&path).unwrap();
    let changed = |at: usize, byte: u8| [&bytes[..at], &[byte], &bytes[at + 1..]].concat();
    let seen = read("other.spz", &changed(32, 9)).unwrap();
    assert!(seen.scene.supplement.is_none() && seen.shown.is_none() && seen.scene.base == alone(shown));
    let what = "has an extension 0x474c0001 that";
    refused("a.spz", &changed(43, 1), &[what, "ends in a scene of"]);
    refused("a.spz", &changed(44, 7), &[what, "is not an SPZ scene"]);
    // One Gaussian less than lobes.
    refused("a.spz", &changed(44 + 8, 19), &[what, "bytes of positions"]);
    for version in 1..=3 {
        let refused = write_scene_as(&path, spz(version), &file).unwrap_err().to_string();
        assert!(refused.contains("20 Gaussians with lobes"), "{refused}");
    }
    assert_eq!(fs::read(&path).unwrap(), bytes);
}

/// Only version 4 has room for settings; a damaged record of them costs nothing else.
#[test]
fn settings_are_in_an_extension() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.spz");
    let trained_with = TrainedWith { background: Some([1.0, 0.5, 0.0]), max_size: Some(400), ..Default::default() };
    let origin = glam::DVec3::new(4.5e6, -1.0, 2.0);
    let file = SceneFile { trained_with, ..Scene { origin, ..sample(1, 20, 1) }.into() };
    write_scene_file(&path, &file).unwrap();
    let back = read_scene_file(&path).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    bytes[40] = b'!';
    assert_eq!(read("a.spz", &bytes).unwrap().scene, Scene { origin: glam::DVec3::ZERO, ..back.scene });
    let (third, notes) = kept(&file, spz(3));
    let notes = notes.join("; ");
    assert!(notes.contains("positions count from") && notes.contains("--background 1,0.5,0 --max-size 400"), "{notes}");
    assert_eq!(third.trained_with, TrainedWith::default());
}

#[test]
fn damage_is_an_error() {
    let (_, bytes) = round_trip(&sample(3, 3, 1), "spz");
    damage("damaged.spz", &bytes, |_| false);
    damage("damaged.spz", &zipped(&legacy(3, 1)), |_| false);
    refused("nothing.spz", &zipped(b"not a scene at all"), &["NGSP"]);
    refused("short.spz", &zipped(b"NGSP"), &["4 bytes", "header of 16"]);
    refused("other.gz", &zipped(&[0; 100]), &["not an SPZ scene"]);
    refused("new.spz", &zipped(&legacy(9, 1)), &["SPZ version 9", "expected 1 to 3"]);
    refused("many.spz", &zipped(&legacy(3, 2)), &["expected", "2 Gaussians"]);
    let mut broken = legacy(1, 1);
    broken[16..18].copy_from_slice(&[0x00, 0x7e]);
    refused("broken.spz", &zipped(&broken), &["row 0: `x` is not a finite number"]);
    dropped("broken.spz", &zipped(&broken), 1, 0);
    // The file is too small for the count in its header.
    refused("bomb.spz", &zipped(&legacy(3, u32::MAX)), &["4294967295 Gaussians", "expected no more than"]);
    let promising = |at: usize, byte: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = byte;
        bytes
    };
    refused("bomb.spz", &promising(11, 200), &["Gaussians", "expected no more than"]);
    refused("more.spz", &promising(8, 4), &["27 bytes of positions", "expected 36 of 4 Gaussians"]);
    refused("degree.spz", &promising(12, 4), &["SH degree 4"]);
    refused("streams.spz", &promising(15, 5), &["5 streams", "expected 6"]);
    refused("version.spz", &promising(4, 5), &["SPZ version 5"]);
    refused("table.spz", &promising(18, 1), &["table of streams"]);
    refused("bits.spz", &promising(13, 40), &["40 fractional bits"]);
    refused("longer.spz", &[&bytes[..], b"more"].concat(), &["4 bytes behind its last stream"]);
}
