//! Host adapters of the twins of scan, radix sort and dispatch arguments.

use super::Outcome;
use crate::{
    reference as twin,
    stages::{
        constants::status::NO_RESOURCE,
        kernels,
        status::{Resource, Status},
    },
};

twins!(dispatch_args, radix_downsweep, radix_spine, radix_upsweep, scan_apply, scan_reduce, scan_spine);

/// Items of `count`, at most those for whose blocks the dispatch has subgroups; and their blocks.
fn blocks(count: u32, block: u32, subgroups: usize) -> (usize, usize) {
    let items = (count as usize).min(subgroups * block as usize);
    (items, items.div_ceil(block as usize))
}

pub(super) fn dispatch_args(h: kernels::dispatch_args::Host<'_>) -> Outcome {
    let kernels::dispatch_args::Push { count_index, capacity, items_per_group, args_index, resource_index } = h.push;
    let count = &mut h.count[count_index as usize];
    let (kept, overflow, groups) = twin::dispatch_args::dispatch_args(*count, capacity, items_per_group);
    if resource_index != NO_RESOURCE {
        let resource = Resource::ALL.get(resource_index as usize);
        let resource = *resource.ok_or_else(|| format!("there is no resource {resource_index}"))?;
        let mut status = Status::read(h.status);
        status.ask(resource, *count);
        overflow.into_iter().for_each(|needed| status.fail(resource, needed));
        h.status[..status.0.len()].copy_from_slice(&status.0);
    }
    *count = kept;
    h.dispatch_args[args_index as usize..][..3].copy_from_slice(&groups);
    Ok(())
}

pub(super) fn scan_reduce(h: kernels::scan_reduce::Host<'_>) -> Outcome {
    let block = h.spec.block;
    let (items, blocks) = blocks(h.count[h.push.count_index as usize], block, h.workgroups.subgroups());
    let (values, index) = scanned(h.values, h.index, h.spec.gather, items);
    h.block_sums[..blocks].copy_from_slice(&twin::scan_reduce::scan_reduce(values, index, block as usize));
    Ok(())
}

/// Arguments of a scan's twin: values, and the index, which is not read without `gather`.
fn scanned<'a>(values: &'a [u32], index: &'a [u32], gather: bool, items: usize) -> (&'a [u32], Option<&'a [u32]>) {
    if gather { (values, Some(&index[..items])) } else { (&values[..items], None) }
}

pub(super) fn scan_spine(h: kernels::scan_spine::Host<'_>) -> Outcome {
    let kernels::scan_spine::Push { count_index, total_index } = h.push;
    let blocks = h.count[count_index as usize].div_ceil(h.spec.block) as usize;
    let begins = twin::scan_spine::scan_spine(&h.block_sums[..blocks]);
    h.block_sums[..=blocks].copy_from_slice(&begins);
    h.count[total_index as usize] = begins[blocks];
    Ok(())
}

pub(super) fn scan_apply(h: kernels::scan_apply::Host<'_>) -> Outcome {
    let block = h.spec.block;
    let (items, blocks) = blocks(h.count[h.push.count_index as usize], block, h.workgroups.subgroups());
    let (values, index) = scanned(h.values, h.index, h.spec.gather, items);
    let offsets = twin::scan_apply::scan_apply(values, index, &h.block_sums[..blocks], block as usize);
    h.offsets[..items].copy_from_slice(&offsets);
    Ok(())
}

pub(super) fn radix_upsweep(h: kernels::radix_upsweep::Host<'_>) -> Outcome {
    let kernels::radix_upsweep::Push { count_index, shift } = h.push;
    let kernels::radix_upsweep::Spec { block, digit_bits, compact, .. } = h.spec;
    let (keys, _) = blocks(h.count[count_index as usize], block, h.workgroups.subgroups());
    let counts = twin::radix_upsweep::radix_upsweep(&h.keys_in[..keys], shift, digit_bits, compact, block as usize);
    h.block_counts[..counts.len()].copy_from_slice(&counts);
    Ok(())
}

pub(super) fn radix_spine(h: kernels::radix_spine::Host<'_>) -> Outcome {
    let digit_bits = h.spec.digit_bits;
    let blocks = h.count[h.push.count_index as usize].div_ceil(h.spec.block) as usize;
    let counts = &mut h.block_counts[..blocks << digit_bits];
    let (before, totals) = twin::radix_spine::radix_spine(counts, digit_bits);
    counts.copy_from_slice(&before);
    h.digit_totals[..totals.len()].copy_from_slice(&totals);
    Ok(())
}

pub(super) fn radix_downsweep(h: kernels::radix_downsweep::Host<'_>) -> Outcome {
    let kernels::radix_downsweep::Push { count_index, kept_index, shift } = h.push;
    let kernels::radix_downsweep::Spec { block, digit_bits, compact, indexed, .. } = h.spec;
    let (items, blocks) = blocks(h.count[count_index as usize], block, h.workgroups.subgroups());
    let (keys, values) = twin::radix_downsweep::radix_downsweep(
        (&h.keys_in[..items], (!indexed).then(|| &h.values_in[..items])),
        compact,
        &h.block_counts[..blocks << digit_bits],
        &h.digit_totals[..1 << digit_bits],
        shift,
        digit_bits,
        block as usize,
    );
    h.keys_out[..keys.len()].copy_from_slice(&keys);
    h.values_out[..values.len()].copy_from_slice(&values);
    if compact {
        h.count[kept_index as usize] = keys.len() as u32;
    }
    Ok(())
}
