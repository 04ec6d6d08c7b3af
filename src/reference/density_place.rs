//! New numbers of what stays.

/// By old number the new one, none where the Gaussian does not stay. `ranks` says how many before it do; all stay where as many are
/// to stay as there are.
pub fn density_place(alive: &[u32], ranks: &[u32], stays: u32) -> Vec<Option<u32>> {
    let all = stays as usize == alive.len();
    let place = |(number, (&alive, &rank)): (usize, (&u32, &u32))| match all {
        true => Some(number as u32),
        false => (alive != 0).then_some(rank),
    };
    alive.iter().zip(ranks).enumerate().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stays_closes_ranks() {
        assert_eq!(density_place(&[1, 0, 1], &[0, 1, 1], 2), [Some(0), None, Some(1)]);
        assert_eq!(density_place(&[0, 0], &[0, 0], 2), [Some(0), Some(1)]);
    }
}
