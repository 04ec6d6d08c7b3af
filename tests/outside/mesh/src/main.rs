//! Draws a quad with a graphics pipeline, then a scene over it with glint, into one image: each hides the
//! other if it is nearer.
//!
//!     mesh NUMBERS SCENE.ply OUT
//!
//! NUMBERS is a text file: width, height, a view matrix, a projection matrix (both column-major), four
//! corners of the quad in the world. OUT gets the image's float32 RGBA, rows from the top.

use std::{env, fs, io::Cursor, slice};

use glam::{DMat4, DVec3};
use glint::{
    data::read_scene,
    gpu::{
        BorrowedDevice, Context, FeatureChain, ImageRegion, Kept, Pixels, Recorder,
        ash::{self, util::read_spv, vk},
    },
    pipelines::{
        frames::{Blend, Frame, FrameView, Frames, Instance, Limits, SYNC_READ, SYNC_WRITTEN, Target, Texel},
        model::{Room, Upload},
    },
};

/// The objects lent to glint, and this renderer's own.
struct Renderer {
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    family: u32,
    queue: vk::Queue,
    pool: vk::CommandPool,
}

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const COLOR: vk::Format = vk::Format::R32G32B32A32_SFLOAT;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
/// Colors of the quad, and of the sky.
const QUAD: [f32; 4] = [0.8, 0.3, 0.1, 1.0];
const SKY: [f32; 4] = [0.2, 0.4, 0.6, 1.0];

fn main() -> Outcome<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [numbers, scene, out] = &arguments[..] else { return Err("mesh NUMBERS SCENE.ply OUT".into()) };
    let numbers: Vec<f64> = fs::read_to_string(numbers)?.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    let [width, height, matrices @ ..] = &numbers[..] else { return Err("numbers are missing".into()) };
    let (width, height) = (*width as u32, *height as u32);
    let view = DMat4::from_cols_slice(&matrices[..16]);
    let projection = DMat4::from_cols_slice(&matrices[16..32]);
    let corners: Vec<DVec3> = matrices[32..44].chunks_exact(3).map(DVec3::from_slice).collect();

    let entry = unsafe { ash::Entry::load()? };
    let r = unsafe { Renderer::new(&entry)? };
    let pixels = unsafe { r.draw(&entry, [width, height], view, projection, &corners, scene)? };
    fs::write(out, pixels.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
    unsafe { r.destroy() };
    Ok(())
}

impl Renderer {
    /// A device with a queue for graphics and compute, made with glint's requirements.
    unsafe fn new(entry: &ash::Entry) -> Outcome<Self> {
        unsafe {
            let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&app);
            let instance = entry.create_instance(&info, None)?;
            let physical = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan device")?;
            let families = instance.get_physical_device_queue_family_properties(physical);
            let wanted = vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS;
            let family = families.iter().position(|f| f.queue_flags.contains(wanted)).ok_or("no queue")? as u32;
            let needed = Context::requirements();
            let extensions: Vec<_> = needed.extensions.iter().map(|e| e.as_ptr()).collect();
            let mut chain = FeatureChain::new(needed.features);
            let mut features = chain.link();
            let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            let device = instance.create_device(physical, &info, None)?;
            let queue = device.get_device_queue(family, 0);
            let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&info, None)?;
            Ok(Renderer { instance, physical, device, family, queue, pool })
        }
    }

    unsafe fn draw(
        &self,
        entry: &ash::Entry,
        [width, height]: [u32; 2],
        view: DMat4,
        projection: DMat4,
        corners: &[DVec3],
        scene: &str,
    ) -> Outcome<Vec<f32>> {
        let device = &self.device;
        // This renderer's own objects.
        let usage = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        let color = unsafe { self.image(COLOR, usage | vk::ImageUsageFlags::COLOR_ATTACHMENT, [width, height])? };
        let usage = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT;
        let depth = unsafe { self.image(DEPTH, usage, [width, height])? };
        let bytes = 16 * u64::from(width) * u64::from(height);
        let (result, memory) = unsafe { self.host_buffer(bytes)? };
        let quad = unsafe { Quad::new(device, [color.view, depth.view], [width, height])? };

        // glint's objects.
        let context = unsafe {
            Context::borrow(BorrowedDevice {
                entry: entry.clone(),
                instance: self.instance.clone(),
                physical_device: self.physical,
                device: device.clone(),
                queue_family: self.family,
                queue: self.queue,
                optional: Default::default(),
                pipeline_cache: vk::PipelineCache::null(),
                queue_lock: None,
                labels: false,
                memory_budget: None,
            })?
        };
        let upload = Upload::prepare(&context, DVec3::ZERO, &read_scene(scene)?, Room { half: false, ..Default::default() })?;
        let mut kept = Kept::default();
        unsafe {
            self.run(|commands| {
                let mut recorder = Recorder::borrow(&context, commands, Kept::default());
                upload.record(&mut recorder)?;
                kept = recorder.finish();
                Ok(())
            })?;
        }
        let model = upload.finish()?;
        let limits = Limits { depth_in: true, texel: Texel::Rgba32F, ..Limits::of(&model, width, height) };
        let mut frames = Frames::new(&context, limits)?;

        // One frame: the quad, then the scene over it, and the result to the host.
        let seen = FrameView::from_matrices(view, projection, width, height)?;
        let target = Pixels::Image(ImageRegion::of(color.image, COLOR, vk::ImageLayout::GENERAL));
        let hides = Pixels::Image(ImageRegion::of(depth.image, DEPTH, vk::ImageLayout::TRANSFER_SRC_OPTIMAL));
        let seen = FrameView {
            color: Some(Target { blend: Blend::Over, ..Target::new(target, Texel::Rgba32F) }),
            depth_in: Some(hides),
            ..seen
        };
        let clip: Vec<f32> =
            corners.iter().flat_map(|c| (projection * view * c.extend(1.0)).as_vec4().to_array()).collect();
        unsafe {
            self.run(|commands| {
                // The render pass leaves both images in the layouts that glint expects, see `Quad::new`.
                quad.record(device, commands, &clip, [width, height]);
                frames.record(commands, &Frame { slot: 0, instances: &[Instance::of(&model)], views: &[seen] })?;
                let written = [vk::MemoryBarrier::default()
                    .src_access_mask(SYNC_WRITTEN.1)
                    .dst_access_mask(vk::AccessFlags::TRANSFER_READ)];
                let (transfer, none) = (vk::PipelineStageFlags::TRANSFER, vk::DependencyFlags::empty());
                device.cmd_pipeline_barrier(commands, transfer, transfer, none, &written, &[], &[]);
                let region = [vk::BufferImageCopy::default()
                    .image_extent(vk::Extent3D { width, height, depth: 1 })
                    .image_subresource(layers(vk::ImageAspectFlags::COLOR))];
                device.cmd_copy_image_to_buffer(commands, color.image, vk::ImageLayout::GENERAL, result, &region);
                Ok(())
            })?;
            let report = frames.report(0)?;
            if let Some(needed) = report.needed {
                return Err(format!("{needed} intersections found no room").into());
            }
            let mapped = device.map_memory(memory, 0, bytes, vk::MemoryMapFlags::empty())?;
            let pixels = slice::from_raw_parts(mapped.cast::<f32>(), bytes as usize / 4).to_vec();
            // glint's handles are dropped before the device.
            drop((frames, model, kept, context));
            quad.destroy(device);
            device.destroy_buffer(result, None);
            device.free_memory(memory, None);
            for image in [color, depth] {
                device.destroy_image_view(image.view, None);
                device.destroy_image(image.image, None);
                device.free_memory(image.memory, None);
            }
            Ok(pixels)
        }
    }

    /// Records, submits, and waits.
    unsafe fn run(&self, record: impl FnOnce(vk::CommandBuffer) -> Outcome<()>) -> Outcome<()> {
        let device = &self.device;
        unsafe {
            let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = device.allocate_command_buffers(&info)?;
            device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default())?;
            record(commands[0])?;
            device.end_command_buffer(commands[0])?;
            device.queue_submit(self.queue, &[vk::SubmitInfo::default().command_buffers(&commands)], vk::Fence::null())?;
            device.queue_wait_idle(self.queue)?;
            device.free_command_buffers(self.pool, &commands);
        }
        Ok(())
    }

    unsafe fn image(&self, format: vk::Format, usage: vk::ImageUsageFlags, [width, height]: [u32; 2]) -> Outcome<Image> {
        let device = &self.device;
        unsafe {
            let info = vk::ImageCreateInfo::default()
                .image_type(vk::ImageType::TYPE_2D)
                .format(format)
                .extent(vk::Extent3D { width, height, depth: 1 })
                .mip_levels(1)
                .array_layers(1)
                .samples(vk::SampleCountFlags::TYPE_1)
                .usage(usage);
            let image = device.create_image(&info, None)?;
            let memory = self.memory(device.get_image_memory_requirements(image), vk::MemoryPropertyFlags::empty())?;
            device.bind_image_memory(image, memory, 0)?;
            let aspect = if format == DEPTH { vk::ImageAspectFlags::DEPTH } else { vk::ImageAspectFlags::COLOR };
            let range = vk::ImageSubresourceRange { aspect_mask: aspect, level_count: 1, layer_count: 1, ..Default::default() };
            let info = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(format)
                .subresource_range(range);
            Ok(Image { image, memory, view: device.create_image_view(&info, None)? })
        }
    }

    unsafe fn host_buffer(&self, bytes: u64) -> Outcome<(vk::Buffer, vk::DeviceMemory)> {
        let device = &self.device;
        unsafe {
            let info = vk::BufferCreateInfo::default().size(bytes).usage(vk::BufferUsageFlags::TRANSFER_DST);
            let buffer = device.create_buffer(&info, None)?;
            let host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let memory = self.memory(device.get_buffer_memory_requirements(buffer), host)?;
            device.bind_buffer_memory(buffer, memory, 0)?;
            Ok((buffer, memory))
        }
    }

    unsafe fn memory(&self, needs: vk::MemoryRequirements, wanted: vk::MemoryPropertyFlags) -> Outcome<vk::DeviceMemory> {
        unsafe {
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let fits = |&i: &u32| {
                needs.memory_type_bits >> i & 1 != 0 && types.memory_types[i as usize].property_flags.contains(wanted)
            };
            let index = (0..types.memory_type_count).find(fits).ok_or("no memory for it")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
            Ok(self.device.allocate_memory(&info, None)?)
        }
    }

    unsafe fn destroy(self) {
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

struct Image {
    image: vk::Image,
    memory: vk::DeviceMemory,
    view: vk::ImageView,
}

fn layers(aspect_mask: vk::ImageAspectFlags) -> vk::ImageSubresourceLayers {
    vk::ImageSubresourceLayers { aspect_mask, layer_count: 1, ..Default::default() }
}

/// The graphics pipeline of a quad in front of a sky, with depths of 1 at the near plane and 0 at infinity.
struct Quad {
    pass: vk::RenderPass,
    target: vk::Framebuffer,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
}

impl Quad {
    unsafe fn new(device: &ash::Device, views: [vk::ImageView; 2], [width, height]: [u32; 2]) -> Outcome<Self> {
        unsafe {
            let attachment = |format, last| {
                vk::AttachmentDescription::default()
                    .format(format)
                    .samples(vk::SampleCountFlags::TYPE_1)
                    .load_op(vk::AttachmentLoadOp::CLEAR)
                    .store_op(vk::AttachmentStoreOp::STORE)
                    .final_layout(last)
            };
            // In the layouts passed to glint.
            let attachments = [
                attachment(COLOR, vk::ImageLayout::GENERAL),
                attachment(DEPTH, vk::ImageLayout::TRANSFER_SRC_OPTIMAL),
            ];
            let reference = |attachment, layout| vk::AttachmentReference { attachment, layout };
            let colors = [reference(0, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)];
            let depth = reference(1, vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL);
            let subpasses =
                [vk::SubpassDescription::default().color_attachments(&colors).depth_stencil_attachment(&depth)];
            // Before glint's reads and writes.
            let after = [vk::SubpassDependency {
                src_subpass: 0,
                dst_subpass: vk::SUBPASS_EXTERNAL,
                src_stage_mask: vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT
                    | vk::PipelineStageFlags::LATE_FRAGMENT_TESTS,
                dst_stage_mask: SYNC_READ.0 | SYNC_WRITTEN.0,
                src_access_mask: vk::AccessFlags::COLOR_ATTACHMENT_WRITE
                    | vk::AccessFlags::DEPTH_STENCIL_ATTACHMENT_WRITE,
                dst_access_mask: SYNC_READ.1 | SYNC_WRITTEN.1,
                dependency_flags: vk::DependencyFlags::empty(),
            }];
            let info = vk::RenderPassCreateInfo::default()
                .attachments(&attachments)
                .subpasses(&subpasses)
                .dependencies(&after);
            let pass = device.create_render_pass(&info, None)?;
            let info =
                vk::FramebufferCreateInfo::default().render_pass(pass).attachments(&views).width(width).height(height).layers(1);
            let target = device.create_framebuffer(&info, None)?;

            let ranges = [vk::PushConstantRange {
                stage_flags: vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT,
                offset: 0,
                size: 80,
            }];
            let layout = device
                .create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges), None)?;
            let module = |bytes: &[u8]| -> Outcome<vk::ShaderModule> {
                let code = read_spv(&mut Cursor::new(bytes))?;
                Ok(device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&code), None)?)
            };
            let modules = [module(include_bytes!("../mesh.vert.spv"))?, module(include_bytes!("../mesh.frag.spv"))?];
            let stage = |flags, module| {
                vk::PipelineShaderStageCreateInfo::default().stage(flags).module(module).name(c"main")
            };
            let stages = [
                stage(vk::ShaderStageFlags::VERTEX, modules[0]),
                stage(vk::ShaderStageFlags::FRAGMENT, modules[1]),
            ];
            let input = vk::PipelineVertexInputStateCreateInfo::default();
            let assembly =
                vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
            let viewports = [vk::Viewport {
                x: 0.0,
                y: 0.0,
                width: width as f32,
                height: height as f32,
                min_depth: 0.0,
                max_depth: 1.0,
            }];
            let scissors = [vk::Rect2D { extent: vk::Extent2D { width, height }, ..Default::default() }];
            let viewport = vk::PipelineViewportStateCreateInfo::default().viewports(&viewports).scissors(&scissors);
            let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
            let samples = vk::PipelineMultisampleStateCreateInfo::default()
                .rasterization_samples(vk::SampleCountFlags::TYPE_1);
            let depth = vk::PipelineDepthStencilStateCreateInfo::default()
                .depth_test_enable(true)
                .depth_write_enable(true)
                .depth_compare_op(vk::CompareOp::GREATER);
            let blends = [vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA)];
            let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
            let info = [vk::GraphicsPipelineCreateInfo::default()
                .stages(&stages)
                .vertex_input_state(&input)
                .input_assembly_state(&assembly)
                .viewport_state(&viewport)
                .rasterization_state(&raster)
                .multisample_state(&samples)
                .depth_stencil_state(&depth)
                .color_blend_state(&blend)
                .layout(layout)
                .render_pass(pass)];
            let pipeline =
                device.create_graphics_pipelines(vk::PipelineCache::null(), &info, None).map_err(|(_, e)| e)?[0];
            modules.into_iter().for_each(|module| device.destroy_shader_module(module, None));
            Ok(Quad { pass, target, layout, pipeline })
        }
    }

    unsafe fn record(&self, device: &ash::Device, commands: vk::CommandBuffer, clip: &[f32], [width, height]: [u32; 2]) {
        unsafe {
            let clears = [
                vk::ClearValue { color: vk::ClearColorValue { float32: SKY } },
                vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } },
            ];
            let begin = vk::RenderPassBeginInfo::default()
                .render_pass(self.pass)
                .framebuffer(self.target)
                .render_area(vk::Rect2D { extent: vk::Extent2D { width, height }, ..Default::default() })
                .clear_values(&clears);
            device.cmd_begin_render_pass(commands, &begin, vk::SubpassContents::INLINE);
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, self.pipeline);
            let push: Vec<u8> = clip.iter().chain(&QUAD).flat_map(|v| v.to_ne_bytes()).collect();
            let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
            device.cmd_push_constants(commands, self.layout, stages, 0, &push);
            device.cmd_draw(commands, 6, 1, 0, 0);
            device.cmd_end_render_pass(commands);
        }
    }

    unsafe fn destroy(&self, device: &ash::Device) {
        unsafe {
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_framebuffer(self.target, None);
            device.destroy_render_pass(self.pass, None);
        }
    }
}
