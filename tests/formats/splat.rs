//! Tests `.splat`.

use super::*;

#[test]
fn a_record_is_read_as_the_viewer_reads_it() {
    let mut record = Vec::new();
    for value in [1.5f32, -2.0, 0.25, 1.0, std::f32::consts::E, 0.0] {
        record.extend(value.to_le_bytes());
    }
    record.extend([0, 255, 51, 51, 128, 0, 192, 128]);
    let scene = read("one.splat", &record).unwrap().scene;
    let base = &scene.base;
    assert_eq!((base.len(), base.sh_degree, scene.supplement.is_none()), (1, 0, true));
    assert_eq!(base.means, [[1.5, -2.0, 0.25]]);
    let [one, e, flat] = base.log_scales[0];
    assert!(one == 0.0 && (e - 1.0).abs() < 1e-6 && flat < -87.0 && flat.is_finite());
    assert_eq!(base.quats, [[0.0, -1.0, 0.5, 0.0]]);
    // 51/255 = 0.2; 0.5 of color is 0.5/0.282095 of the coefficient.
    let color = base.sh[0].map(|v| f64::from(v) * 0.28209479177387814 + 0.5);
    assert!(color.iter().zip([0.0, 1.0, 0.2]).all(|(a, b)| (a - b).abs() < ROUNDING), "{color:?}");
    assert!((opacity(base, 0)[0] - 0.2).abs() < ROUNDING);
}

#[test]
fn damage_is_an_error() {
    let (_, bytes) = round_trip(&sample(3, 4, 0), "splat");
    damage("damaged.splat", &bytes, |length| length > 0 && length % 32 == 0);
    refused("cut.splat", &bytes[..100], &["3 records", "4 bytes", "32 bytes"]);
    let mut broken = bytes;
    broken[32..36].copy_from_slice(&f32::NAN.to_le_bytes());
    refused("broken.splat", &broken, &["row 1: `x` is not a finite number"]);
    dropped("broken.splat", &broken, 1, 3);
    broken[32..36].copy_from_slice(&0f32.to_le_bytes());
    broken[76..80].copy_from_slice(&(-1f32).to_le_bytes());
    refused("broken.splat", &broken, &["row 2: `scale_0` is not a finite number"]);
}
