//! Twin of `glsl/shared/packed_record.glsl`: a gradient record in four words.

use super::blend_backward::Record;

/// In word 0: marks a Gaussian that learns only its opacity.
const OPACITY_MARK: u32 = 1 << 30;

/// Packs a record into four words, through float32. `opacity_only`: the record's first number is a mark, and
/// packed as one.
pub fn pack_record(record: &Record, opacity_only: bool) -> [u32; 4] {
    let mut numbers = record.map(|part| part as f32);
    if opacity_only {
        numbers[0] = 0.0;
    }
    let units = units_of(&numbers);
    let codes = |first: usize| {
        (0..3).map(|c| code(numbers[first + c], units[unit_at(first + c)]) << (10 * c)).fold(0, |a, b| a | b)
    };
    let mark = if opacity_only { OPACITY_MARK } else { 0 };
    [codes(0) | mark, codes(3), codes(6), u32::from_le_bytes(units)]
}

/// Unpacks the record in four words.
pub fn unpack_record(words: [u32; 4]) -> Record {
    let units = words[3].to_le_bytes();
    let mut record: Record = std::array::from_fn(|k| {
        let number = (words[k / 3] << (22 - 10 * (k % 3))) as i32 >> 22;
        f64::from(number) * unit(units[unit_at(k)])
    });
    if words[0] & OPACITY_MARK != 0 {
        record[0] = 1.0;
    }
    record
}

/// Exponents of the units: of the centre's first two numbers, of the shape, of the color, of the opacity.
fn units_of(numbers: &[f32; 9]) -> [u8; 4] {
    let of = |parts: &[f32]| {
        let largest = parts.iter().map(|part| part.abs().to_bits()).max().unwrap_or(0) >> 23;
        if largest == 255 { 255 } else { largest.saturating_sub(8) as u8 }
    };
    [of(&numbers[..2]), of(&numbers[3..6]), of(&numbers[6..]), of(&numbers[2..3])]
}

/// Number of the unit of part `k` of a record.
fn unit_at(k: usize) -> usize {
    if k == 2 { 3 } else { k / 3 }
}

fn unit(exponent: u8) -> f64 {
    f64::from(f32::from_bits(u32::from(exponent) << 23))
}

fn code(x: f32, exponent: u8) -> u32 {
    if exponent == 255 {
        return 1;
    }
    let by = f32::from_bits((254 - u32::from(exponent)) << 23);
    (x * by).round_ties_even().clamp(-511.0, 511.0) as i32 as u32 & 0x3ff
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error is half a unit, a 512th of the power of two below the largest of a part. The largest itself
    /// may lose another half, if it rounds up to 512.
    #[test]
    fn numbers_are_right_to_a_512th_of_the_largest_of_their_part() {
        let mut seed = 1u32;
        let mut random = || {
            seed = seed.wrapping_mul(0x2c1b_3c6d).wrapping_add(12345);
            f64::from(seed >> 8) / f64::from(1 << 24) * 2.0 - 1.0
        };
        for power in [-100, -30, -3, 0, 20, 100] {
            for _ in 0..100 {
                let record: Record = std::array::from_fn(|k| random() * 2f64.powi(power + [0, 5, -9][k / 3]));
                let again = unpack_record(pack_record(&record, false));
                for k in 0..9 {
                    let part = if k == 2 { 2..3 } else { (k / 3 * 3)..(k / 3 * 3 + if k < 3 { 2 } else { 3 }) };
                    let largest = record[part].iter().fold(0.0f64, |a, b| a.max(b.abs()));
                    assert!((record[k] - again[k]).abs() <= largest / 511.0, "{} became {}", record[k], again[k]);
                }
            }
        }
    }

    #[test]
    fn zeros_marks_and_what_is_not_finite() {
        assert_eq!(pack_record(&[0.0; 9], false), [0; 4]);
        assert_eq!(unpack_record([0; 4]), [0.0; 9]);
        let mut alone = [0.0; 9];
        (alone[0], alone[2]) = (1.0, -3e-7);
        let again = unpack_record(pack_record(&alone, true));
        assert_eq!([again[0], again[1]], [1.0, 0.0]);
        assert!((again[2] / -3e-7 - 1.0).abs() < 1.0 / 256.0);
        for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e39] {
            for k in 0..9 {
                let mut record = [0.5; 9];
                record[k] = bad;
                let again = unpack_record(pack_record(&record, false));
                assert!(!again[k].is_finite(), "{bad} as part {k} became {}", again[k]);
            }
        }
    }
}
