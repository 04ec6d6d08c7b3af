//! Twin of `density_place.comp`: renumbers the Gaussians that stay.

/// Returns the new number by old number, none for a Gaussian that does not stay. `ranks` counts those before
/// it that stay. If `stays` equals the number of Gaussians, all stay.
pub fn density_place(alive: &[u32], ranks: &[u32], stays: u32) -> Vec<Option<u32>> {
    let all = stays as usize == alive.len();
    let place = |(number, (&alive, &rank)): (usize, (&u32, &u32))| match all {
        true => Some(number as u32),
        false => (alive != 0).then_some(rank),
    };
    alive.iter().zip(ranks).enumerate().map(place).collect()
}
