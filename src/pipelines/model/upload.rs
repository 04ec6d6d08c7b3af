//! Uploads a model by the caller's command buffer.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;

use super::{Model, NAMES, Quads, Room, Segment, segments_of};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, DeviceInfo, Location, Recorder},
    pipelines::plan::{Plan, Planned},
    scene::{Scene, Supplement},
    stages::{status, types::Page},
};

/// An upload of a scene by the caller's own command buffer: it does not submit or wait. Any thread may
/// prepare it while others draw.
///
/// The command buffer may belong to another queue than the frames', if that queue supports compute; separate
/// the two by a semaphore. Buffers belong to one queue family: from another family, release each of
/// [`Model::held`] there, and acquire it on the frames' queue before the first frame. As with a frame, the
/// bound compute pipeline, descriptor set 0 and push constants change. Keep the result of
/// [`Recorder::finish`](crate::gpu::Recorder::finish) until the commands have run.
pub struct Upload {
    model: Model,
    /// Pairs of staging memory and its destination.
    staged: Vec<(Quads, Quads)>,
    status: Buffer<u32>,
    /// Until it is set, the model has neither contents nor counts.
    recorded: AtomicBool,
}

impl Upload {
    /// Memory of an upload in addition to its model, until its commands have run. It is host memory, which
    /// counts against a context's budget if device and host share theirs, and as large as the filled pages.
    /// [`Model::upload_around`], which waits, stages at most 64 MiB.
    pub fn plan(device: &DeviceInfo, scene: &Scene, room: Room) -> Plan {
        let (degrees, counts) = (room.degrees(scene), Room::counts(scene));
        let limit = room.page_limit(device, room.degree(scene));
        let mut plan = Plan::default();
        for (segment, capacity) in Segment::ALL.into_iter().zip(room.capacities(counts)) {
            let s = segment as usize;
            // Pages are staged whole.
            let elements = capacity.min(counts[s].div_ceil(limit).saturating_mul(limit)).into();
            let rows = NAMES[s].into_iter().zip(room.bytes(segment, degrees[s]));
            let rows = rows.map(|(name, element_bytes)| Planned { name, elements, element_bytes });
            plan.0.extend(rows.filter(|row| row.elements * row.element_bytes > 0));
        }
        plan.0.push(Planned { name: "recount status", elements: status::WORDS as u64, element_bytes: 4 });
        plan
    }

    /// Allocates device memory for `scene`, in coordinates relative to `origin`, and fills staging memory on
    /// the host: see [`Model::plan`] and [`Upload::plan`].
    ///
    /// # Errors
    /// If memory does not suffice.
    pub fn prepare(context: &Context, origin: DVec3, scene: &Scene, room: Room) -> Result<Self> {
        let model = Model::allocate(context, origin, scene, room)?;
        let mut staged = Vec::new();
        for (part, content) in model.parts.iter().zip(segments_of(scene, &Supplement::default())) {
            for k in 0..part.pages.len() {
                for (planes, values) in part.values(k, &content, origin - scene.origin) {
                    let staging = Buffer::new(context, "staging", values.len(), Location::Host)?;
                    staging.write_mapped(&values);
                    staged.push((staging, planes.clone()));
                }
            }
        }
        let status = Buffer::new(context, "recount status", status::WORDS, Location::Device)?;
        Ok(Upload { model, staged, status, recorded: AtomicBool::new(false) })
    }

    /// Records the copies, and the kernel that makes dispatches from the counts. The command buffer's queue
    /// must support compute.
    ///
    /// # Errors
    /// [`Error::Usage`] if the recorder is of another context; then nothing is recorded.
    pub fn record(&self, recorder: &mut Recorder) -> Result<()> {
        if !recorder.context().is_same(&self.model.context) {
            return Err(Error::Usage("a recorder of another context than the upload's".into()));
        }
        for (staging, planes) in &self.staged {
            recorder.copy(staging, 0, planes, 0, staging.len());
        }
        let pages: Vec<Page> = self.model.parts.iter().flat_map(|part| part.pages.iter().copied()).collect();
        recorder.update(&self.model.pages, 0, &pages);
        recorder.update(&self.model.segment_counts, 0, &self.model.known);
        recorder.fill(&self.status, 0);
        self.model.record_recount(recorder, None, &self.status);
        // Any later command on the queue may read it.
        recorder.barrier();
        self.recorded.store(true, Ordering::Release);
        Ok(())
    }

    /// Whether [`Upload::record`] was called.
    pub fn is_recorded(&self) -> bool {
        self.recorded.load(Ordering::Acquire)
    }

    /// Returns the model. The commands need not have run yet, as long as readers come later on the same
    /// queue, or wait. The recorded commands keep the staging memory (see [`Kept`](crate::gpu::Kept)).
    ///
    /// # Errors
    /// [`Error::Usage`] if it was not recorded: frames would draw uninitialised memory with an arbitrary
    /// count.
    pub fn finish(self) -> Result<Model> {
        match self.is_recorded() {
            true => Ok(self.model),
            false => Err(Error::Usage("an upload that was not recorded has nothing on the device".into())),
        }
    }
}
