//! Status words that stages report: steps done, and resources that were too small.

use std::fmt;

use super::constants::status::*;

/// Number of words of `status`.
pub const WORDS: usize = (STATUS_NEEDED + RESOURCES) as usize;

/// The word that counts steps.
pub const STEPS: usize = STATUS_STEPS as usize;

/// Resources that can be too small; the host enlarges them between submissions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resource {
    /// Intersections of splats and tiles.
    Intersections = INTERSECTIONS as isize,
    /// The base's capacity.
    BaseGaussians = BASE_GAUSSIANS as isize,
    /// The capacity of Gaussians with bands.
    BandedGaussians = BANDED_GAUSSIANS as isize,
    /// The supplement's capacity.
    SupplementGaussians = SUPPLEMENT_GAUSSIANS as isize,
}

impl Resource {
    /// All resources, in the order of their bits.
    pub const ALL: [Resource; RESOURCES as usize] =
        [Resource::Intersections, Resource::BaseGaussians, Resource::BandedGaussians, Resource::SupplementGaussians];

    /// Its number in kernels.
    pub fn index(self) -> u32 {
        self as u32
    }
}

impl fmt::Display for Resource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Resource::Intersections => "intersections",
            Resource::BaseGaussians => "base Gaussians",
            Resource::BandedGaussians => "Gaussians with bands",
            Resource::SupplementGaussians => "supplementary Gaussians",
        })
    }
}

/// The words of `status`, read back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Status(pub [u32; WORDS]);

impl Status {
    /// Reads the words of a status buffer.
    pub fn read(words: &[u32]) -> Self {
        let mut status = Status::default();
        status.0.iter_mut().zip(words).for_each(|(to, from)| *to = *from);
        status
    }

    /// The initial status of a loop with `done` steps already done.
    pub fn of_steps(done: u32) -> Self {
        let mut status = Status::default();
        status.0[STEPS] = done;
        status
    }

    /// Reports a demand of `needed` for a resource, like a kernel.
    pub fn ask(&mut self, resource: Resource, needed: u32) {
        let most = &mut self.0[(STATUS_NEEDED + resource.index()) as usize];
        *most = needed.max(*most);
    }

    /// Reports that a demand of `needed` for a resource did not fit, like a kernel.
    pub fn fail(&mut self, resource: Resource, needed: u32) {
        self.0[STATUS_FAILED as usize] |= 1 << resource.index();
        self.ask(resource, needed);
    }

    /// Steps completed.
    pub fn steps(&self) -> u32 {
        self.0[STATUS_STEPS as usize]
    }

    /// True if a resource was too small, so that nothing has changed since.
    pub fn failed(&self) -> bool {
        self.0[STATUS_FAILED as usize] != 0
    }

    /// The largest demand for a resource: of intersections always, of others only if it did not fit.
    pub fn asked(&self, resource: Resource) -> u32 {
        self.0[(STATUS_NEEDED + resource.index()) as usize]
    }

    /// Resources that were too small, and the largest demand for each.
    pub fn needs(&self) -> impl Iterator<Item = (Resource, u32)> + '_ {
        let failed = self.0[STATUS_FAILED as usize];
        Resource::ALL.into_iter().filter(move |r| failed >> r.index() & 1 != 0).map(move |r| (r, self.asked(r)))
    }

    /// The largest demand for a resource that was too small.
    pub fn needed(&self, resource: Resource) -> Option<u32> {
        self.needs().find(|(r, _)| *r == resource).map(|(_, n)| n)
    }
}
