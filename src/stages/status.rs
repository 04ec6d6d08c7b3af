//! What stages report: steps done, and what was too small.

use std::fmt;

use super::constants::status::*;

/// Words of `status`.
pub const WORDS: usize = (STATUS_NEEDED + RESOURCES) as usize;

/// The word that counts steps.
pub const STEPS: usize = STATUS_STEPS as usize;

/// What can be too small; made room for between submissions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resource {
    /// Of splats with tiles.
    Intersections = INTERSECTIONS as isize,
    /// The base's capacity.
    BaseGaussians = BASE_GAUSSIANS as isize,
    /// The supplement's capacity.
    SupplementGaussians = SUPPLEMENT_GAUSSIANS as isize,
}

impl Resource {
    /// In the order of their bits.
    pub const ALL: [Resource; RESOURCES as usize] =
        [Resource::Intersections, Resource::BaseGaussians, Resource::SupplementGaussians];

    /// As kernels are given it.
    pub fn index(self) -> u32 {
        self as u32
    }
}

impl fmt::Display for Resource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Resource::Intersections => "intersections",
            Resource::BaseGaussians => "base Gaussians",
            Resource::SupplementGaussians => "supplementary Gaussians",
        })
    }
}

/// The words of `status`, read back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Status(pub [u32; WORDS]);

impl Status {
    /// What the words of a status buffer say.
    pub fn read(words: &[u32]) -> Self {
        let mut status = Status::default();
        status.0.iter_mut().zip(words).for_each(|(to, from)| *to = *from);
        status
    }

    /// What a loop begins with, `done` steps of which are done.
    pub fn of_steps(done: u32) -> Self {
        let mut status = Status::default();
        status.0[STEPS] = done;
        status
    }

    /// As a kernel reports that `needed` of a resource are needed.
    pub fn ask(&mut self, resource: Resource, needed: u32) {
        let most = &mut self.0[(STATUS_NEEDED + resource.index()) as usize];
        *most = needed.max(*most);
    }

    /// As a kernel reports that `needed` of a resource would have been needed.
    pub fn fail(&mut self, resource: Resource, needed: u32) {
        self.0[STATUS_FAILED as usize] |= 1 << resource.index();
        self.ask(resource, needed);
    }

    /// Steps completed.
    pub fn steps(&self) -> u32 {
        self.0[STATUS_STEPS as usize]
    }

    /// Whether something was too small, so that nothing has moved since.
    pub fn failed(&self) -> bool {
        self.0[STATUS_FAILED as usize] != 0
    }

    /// The most that was asked for of a resource; of intersections whether there was room or not.
    pub fn asked(&self, resource: Resource) -> u32 {
        self.0[(STATUS_NEEDED + resource.index()) as usize]
    }

    /// What was too small, and the most that was needed of it.
    pub fn needs(&self) -> impl Iterator<Item = (Resource, u32)> + '_ {
        let failed = self.0[STATUS_FAILED as usize];
        Resource::ALL.into_iter().filter(move |r| failed >> r.index() & 1 != 0).map(move |r| (r, self.asked(r)))
    }

    /// The most that was needed of a resource that was too small.
    pub fn needed(&self, resource: Resource) -> Option<u32> {
        self.needs().find(|(r, _)| *r == resource).map(|(_, n)| n)
    }
}
