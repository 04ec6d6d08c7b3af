//! Tests compressed PLY.

use super::*;

const NAME: &str = "scene.compressed.ply";

/// A file of one Gaussian of degree 1, built from the format's description; with the chunk's bounds of
/// colors if `colored`.
fn fixture(colored: bool) -> Vec<u8> {
    let mut text = String::from("ply\nformat binary_little_endian 1.0\ncomment by hand\nelement chunk 1\n");
    let colors: &[&str] = if colored { &["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"] } else { &[] };
    for kind in ["x", "scale_x"] {
        for end in ["min", "max"] {
            for axis in ["x", "y", "z"] {
                text += &format!("property float {end}_{}\n", kind.replace('x', axis));
            }
        }
    }
    colors.iter().for_each(|name| text += &format!("property float {name}\n"));
    text +=
        "element vertex 1\nproperty uint packed_position\nproperty uint packed_rotation\nproperty uint packed_scale\n";
    text += "property uint packed_color\nelement sh 1\n";
    (0..9).for_each(|i| text += &format!("property uchar f_rest_{i}\n"));
    text += "end_header\n";
    let mut out = text.into_bytes();
    let mut bounds = vec![-1.0f32, 0.0, 10.0, 1.0, 1023.0, 12047.0, -8.0, -6.0, -4.0, -4.0, -2.0, 0.0];
    if colored {
        bounds.extend([0.0, -1.0, 0.5, 1.0, 1.5, 1.0]);
    }
    out.extend(bounds.iter().flat_map(|v| v.to_le_bytes()));
    // The minimum x, step 5 of 1,023 in y, the maximum z.
    let position = 5 << 11 | 2047u32;
    // The largest is the second of w, x, y, z; the others are 0 (up to rounding in a range without a middle),
    // the minimum and 0.
    let rotation = 1 << 30 | 512 << 20 | 511u32;
    let scale = 2047 << 21 | 1023 << 11 | 2047u32;
    let color = u32::from_be_bytes([255, 51, 0, 51]);
    out.extend([position, rotation, scale, color].iter().flat_map(|v| v.to_le_bytes()));
    out.extend([0, 255, 128, 127, 64, 192, 1, 2, 3]);
    out
}

#[test]
fn a_gaussian_is_read_as_described() {
    for colored in [true, false] {
        let base = read(NAME, &fixture(colored)).unwrap().scene.base;
        assert_eq!((base.len(), base.sh_degree), (1, 1));
        assert_eq!(base.means, [[-1.0, 5.0, 12047.0]]);
        assert_eq!(base.log_scales, [[-4.0, -2.0, 0.0]]);
        let color = vector(base.sh[0]).iter().map(|v| 0.5 + 0.28209479177387814 * v).collect::<Vec<_>>();
        let wanted = if colored { [1.0, -0.5, 0.5] } else { [1.0, 0.2, 0.0] };
        assert!(color.iter().zip(wanted).all(|(a, b)| (a - b).abs() < ROUNDING), "{color:?}");
        assert!((opacity(&base, 0)[0] - 0.2).abs() < ROUNDING);
        let [w, x, y, z] = base.quats[0];
        let step = 0.5 * 2f32.sqrt() / 1023.0;
        assert!((w - step).abs() < 1e-6 && (y + 0.5f32.sqrt()).abs() < 1e-6 && (z + step).abs() < 1e-6, "{w} {y} {z}");
        assert!((x - (1.0 - w * w - y * y - z * z).sqrt()).abs() < 1e-6);
        // Channel by channel; bytes 0 and 255 are the ends, others the middle of their 1/256.
        let value = |byte: f32| ((byte + 0.5) / 256.0 - 0.5) * 8.0;
        let wanted = [
            [-4.0, value(127.0), value(1.0)],
            [4.0, value(64.0), value(2.0)],
            [value(128.0), value(192.0), value(3.0)],
        ];
        assert_eq!(base.sh[1..], wanted);
    }
}

#[test]
fn what_is_written_comes_back_within_half_a_step() {
    for (count, degree) in [(300, 0), (256, 1), (5, 2), (513, 3)] {
        let scene = sample(13, count, degree);
        let (back, bytes) = round_trip(&scene, "compressed.ply");
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains(&format!("element chunk {}\n", count.div_ceil(256))));
        let b = &back.base;
        let order = nearest(&scene.base, &b.means);
        let mut once = order.clone();
        once.sort_unstable();
        assert_eq!(once, (0..count).collect::<Vec<_>>(), "each of them once");
        let a = &scene.base.reordered(&order);
        for begin in (0..count).step_by(256) {
            let rows = begin..count.min(begin + 256);
            // Half a step of the chunk's own range, and float32's rounding of numbers up to 12.
            let bound = |of: &dyn Fn(usize) -> Vec<f64>, steps: [f64; 3], what: &str, b: &dyn Fn(usize) -> Vec<f64>| {
                for (part, steps) in steps.into_iter().enumerate() {
                    let values = || rows.clone().map(|i| of(i)[part]);
                    let range = values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min);
                    for i in rows.clone() {
                        let off = (of(i)[part] - b(i)[part]).abs();
                        assert!(off <= 0.5 * range / steps + 2.0 * ROUNDING, "{what} {i}, {part}: {off} of {range}");
                    }
                }
            };
            bound(&|i| means(a, i), [2047.0, 1023.0, 2047.0], "mean", &|i| means(b, i));
            bound(&|i| log_scales(a, i), [2047.0, 1023.0, 2047.0], "scale", &|i| log_scales(b, i));
            bound(&|i| harmonics(0)(a, i), [255.0; 3], "color", &|i| harmonics(0)(b, i));
        }
        assert!(largest(a, b, opacity) <= 0.5 / 255.0 + ROUNDING);
        for band in 1..=degree as usize {
            // Half of 8/256; the middle of the outermost bytes is as far from the ends.
            assert!(largest(a, b, harmonics(band)) <= 0.5 * 8.0 / 256.0 + ROUNDING, "band {band}");
        }
        // Half a step of √2/1023 in each of three components, see SPZ's test.
        let worst = turned(a, b);
        assert!(worst <= 2.0 * 2.0 * 3f64.sqrt() * 0.5 * 2f64.sqrt() / 1023.0, "{worst}");
    }
}

#[test]
fn a_scale_that_is_infinitely_small_does_not_spoil_its_chunk() {
    let mut scene = sample(3, 40, 0);
    scene.base.log_scales[7] = [-1e30, 1e30, 0.0];
    let back = round_trip(&scene, "compressed.ply").0.base;
    let low = back.log_scales.iter().map(|s| s[0]).fold(0.0, f32::min);
    assert_eq!(low, -20.0);
}

#[test]
fn damage_is_an_error() {
    let bytes = fixture(true);
    damage(NAME, &bytes, |_| false);
    let text = |from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    };
    refused(NAME, &text("chunk 1\n", "chunk 2\n"), &["2 rows of element `chunk`, expected 1 of 1 Gaussians"]);
    refused(NAME, &text("vertex 1\n", "vertex 999999999999\n"), &["expected 3906250000 of 999999999999"]);
    refused(NAME, &text("element sh 1\n", "element sh 2\n"), &["2 rows of element `sh`"]);
    refused(NAME, &text("f_rest_8", "f_rest_9"), &["8 properties `f_rest_*`", "9, 24 or 45"]);
    refused(NAME, &text("max_scale_y", "max_scale_w"), &["`chunk` lacks property `max_scale_y`"]);
    refused(NAME, &text("max_b", "max_w"), &["`chunk` lacks property `max_b`"]);
    refused(NAME, &text("uint packed_rotation", "char packed_rotation"), &["`packed_rotation`", "expected uint"]);
    refused(NAME, &text("uchar f_rest_3", "float f_rest_3"), &["f_rest_*", "expected uchar"]);
    refused(NAME, &text("element chunk", "element chink"), &["no element `chunk`"]);
    // NaN in the bounds gives NaN values, which are refused.
    let mut broken = bytes.clone();
    let body = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    broken[body..body + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    refused(NAME, &broken, &["row 0", "`x` is not a finite number"]);
    let (_, mut two) = round_trip(&sample(3, 300, 0), "compressed.ply");
    let body = two.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    two[body + 18 * 4..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    dropped(NAME, &two, 300 - 256, 256);
}

/// SuperSplat wrote both files with the Gaussians in the same order, which gives its authors' view of frames,
/// signs and components.
#[test]
fn two_formats_of_a_real_scene_agree() {
    let (Some(packed), Some(spz)) = (shared("splats/biker.compressed.ply"), shared("splats/biker_v4.spz")) else {
        return;
    };
    let (a, b) = (read_scene(packed).unwrap().base, read_scene(spz).unwrap().base);
    assert_eq!((a.len(), a.sh_degree), (152_746, 0));
    // Each is half a step off the original: SPZ 2^−13 of position, 1/32 of scale, 0.6 % of color over 0.15,
    // and 0.14° of each component; the other's chunks, a few tenths wide, less.
    assert!(largest(&a, &b, means) < 3e-3, "{}", largest(&a, &b, means));
    // SPZ has no logarithm below −10.
    let sizes = |g: &Gaussians, i: usize| log_scales(g, i).iter().map(|v| v.max(-10.0)).collect();
    assert!(largest(&a, &b, sizes) < 1.0 / 32.0 + 5e-3, "{}", largest(&a, &b, sizes));
    assert!(largest(&a, &b, opacity) < 1.0 / 255.0 + ROUNDING, "{}", largest(&a, &b, opacity));
    assert!(
        largest(&a, &b, harmonics(0)) < 0.5 / 255.0 * (1.0 / 0.15 + 2.0 / 0.28),
        "{}",
        largest(&a, &b, harmonics(0))
    );
    assert!(turned(&a, &b) < 0.0024 * 2.0 + 0.0048, "{}", turned(&a, &b));
}
