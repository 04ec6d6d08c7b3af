//! Groups similar rows of numbers (k-means), to build the palette of harmonics.

use rayon::prelude::*;

/// Parts per split, and Lloyd rounds. Each row is compared with 32 centres at a time, so that a million rows
/// take seconds instead of the hours that 65,536 centres at once would take.
const PARTS: usize = 32;
const ROUNDS: usize = 6;

/// Splits rows into at most `budget` groups of similar rows; returns each group's mean and members. Every row
/// is in one group.
///
/// Divisive k-means: groups are split by Lloyd's algorithm until their part of the budget is used.
pub(super) fn groups(rows: &[f32], width: usize, budget: usize) -> Vec<(Vec<f32>, Vec<u32>)> {
    let members: Vec<u32> = (0..(rows.len() / width.max(1)) as u32).collect();
    let mut out = Vec::new();
    split(&Rows { values: rows, width }, members, budget, &mut out);
    out
}

struct Rows<'a> {
    values: &'a [f32],
    width: usize,
}

impl Rows<'_> {
    fn row(&self, i: u32) -> &[f32] {
        &self.values[i as usize * self.width..(i as usize + 1) * self.width]
    }

    fn mean(&self, members: &[u32]) -> Vec<f32> {
        let mut sums = vec![0.0f64; self.width];
        for &i in members {
            sums.iter_mut().zip(self.row(i)).for_each(|(sum, &v)| *sum += f64::from(v));
        }
        sums.into_iter().map(|sum| (sum / members.len() as f64) as f32).collect()
    }
}

fn split(rows: &Rows, members: Vec<u32>, budget: usize, out: &mut Vec<(Vec<f32>, Vec<u32>)>) {
    if members.is_empty() {
        return;
    }
    if members.len() <= budget {
        out.extend(members.iter().map(|&i| (rows.row(i).to_vec(), vec![i])));
        return;
    }
    let parts = if budget > 1 { parts(rows, &members, budget.min(PARTS)) } else { Vec::new() };
    // Equal rows form one group, whatever the budget.
    if parts.len() < 2 {
        out.push((rows.mean(&members), members));
        return;
    }
    // One group per part; the rest of the budget in proportion to their sizes.
    let (more, all) = (budget - parts.len(), members.len());
    let share = |until: usize| (more as u64 * until as u64 / all as u64) as usize;
    let mut until = 0;
    for part in parts {
        let begin = until;
        until += part.len();
        split(rows, part, 1 + share(until) - share(begin), out);
    }
}

/// Splits `members` into at most `k` non-empty parts.
fn parts(rows: &Rows, members: &[u32], k: usize) -> Vec<Vec<u32>> {
    let mut centres: Vec<Vec<f32>> = (0..k).map(|i| rows.row(members[i * members.len() / k]).to_vec()).collect();
    let mut parts = Vec::new();
    for _ in 0..ROUNDS {
        let nearest: Vec<usize> = members.par_iter().map(|&i| nearest(&centres, rows.row(i))).collect();
        parts = vec![Vec::new(); k];
        members.iter().zip(nearest).for_each(|(&i, part)| parts[part].push(i));
        for (centre, part) in centres.iter_mut().zip(&parts).filter(|(_, part)| !part.is_empty()) {
            *centre = rows.mean(part);
        }
    }
    parts.retain(|part| !part.is_empty());
    parts
}

fn nearest(centres: &[Vec<f32>], row: &[f32]) -> usize {
    let distance = |centre: &[f32]| centre.iter().zip(row).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
    let (mut best, mut least) = (0, f32::INFINITY);
    for (i, centre) in centres.iter().enumerate() {
        let found = distance(centre);
        if found < least {
            (best, least) = (i, found);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_no_more_than_asked_for_and_hold_every_row_once() {
        // Forty clusters of 25 rows, far from one another.
        let rows: Vec<f32> = (0..1000).flat_map(|i| [(i % 40) as f32 * 10.0, (i / 40) as f32 * 0.01]).collect();
        for budget in [1, 7, 40, 400, 999, 1000, 5000] {
            let groups = groups(&rows, 2, budget);
            assert!(groups.len() <= budget);
            let mut all: Vec<u32> = groups.iter().flat_map(|(_, members)| members.clone()).collect();
            all.sort_unstable();
            assert_eq!(all, (0..1000).collect::<Vec<_>>(), "{budget}");
            let off = |(centre, members): &(Vec<f32>, Vec<u32>)| {
                members.iter().map(|&i| (rows[2 * i as usize] - centre[0]).abs()).fold(0.0, f32::max)
            };
            let worst = groups.iter().map(off).fold(0.0, f32::max);
            assert!(budget < 400 || worst < 1.0, "{budget}: {worst}");
        }
        assert_eq!(groups(&[1.0; 90], 3, 8).len(), 1);
        assert!(groups(&[], 3, 8).is_empty());
    }
}
