//! HTML page that draws a scene in a browser with WebGPU or WebGL2; a single self-contained file.
//!
//! `viewer/` holds the parts of the page: scripts and shaders. `project.vert` and `blend.frag` implement
//! `glsl/raster/project.comp` and `blend.comp` for WebGL2. Code shared with the kernels is taken from their
//! files; the WGSL for WebGPU takes constants and the harmonics' basis from there. `pack` compresses the
//! scene.

mod pack;

use base64::{Engine, engine::general_purpose::STANDARD};
use glam::DVec3;
use serde::Serialize;

use self::pack::{Packed, bytes_of};
use super::html::escape;
use crate::{
    Error, Result,
    pipelines::views::{JACOBIAN_LIMIT, origin_for},
    reference::NEAR,
    scene::{Camera, Scene, color},
};

/// Maximum length of a text that all browsers can hold, characters (slightly less than 2^29).
const LONGEST: usize = (1 << 29) - 64;

/// Content of a page.
#[derive(Debug)]
pub struct Viewer<'a> {
    /// Title.
    pub title: &'a str,
    /// Scene of any size; browsers cannot open pages with several million Gaussians.
    pub scene: &'a Scene,
    /// Cameras to jump to, by name. If there are none, the page has one that sees most of the scene.
    pub cameras: Vec<(&'a str, Camera)>,
    /// Point that the camera orbits, if known.
    pub focus: Option<DVec3>,
    /// Background, sRGB.
    pub background: [f32; 3],
    /// Whether Gaussians smaller than a pixel are faded, see `Policy::compensate`.
    pub compensate: bool,
}

/// Camera in the page's format; coordinates count from the scene's origin.
#[derive(Serialize)]
struct Shot<'a> {
    name: &'a str,
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    /// Rotation from world to camera, by rows.
    rotation: [f64; 9],
    translation: [f64; 3],
}

/// Data of the page except for the blocks of numbers.
#[derive(Serialize)]
struct Description<'a> {
    base: usize,
    supplement: usize,
    degree: u32,
    with_harmonics: usize,
    log_scales: [f32; 2],
    compensate: bool,
    near: f64,
    jacobian_limit: f64,
    background: [f32; 3],
    focus: [f64; 3],
    /// World coordinates of the origin, for cameras given by numbers.
    origin: [f64; 3],
    cameras: Vec<Shot<'a>>,
}

impl Viewer<'_> {
    /// Bytes of a Gaussian without and with a lobe, before encoding as text of 4/3 the length.
    pub fn bytes_per_gaussian(&self) -> [usize; 2] {
        let base = self.scene.base.sh_degree;
        bytes_of([base, self.scene.supplement.as_ref().map_or(base, |s| s.gaussians.sh_degree)])
    }

    /// Writes the page.
    ///
    /// # Errors
    /// [`Error::Usage`] if the scene is too large for a page, or if its colors are not harmonics.
    pub fn page(&self) -> Result<String> {
        let colors = color::of(self.scene.base.sh_degree);
        if colors.harmonics.is_none() {
            return Err(Error::Usage(format!("a page cannot show {}, expected harmonics", colors.name)));
        }
        let start = [("start", overview(self.scene))];
        let cameras = if self.cameras.is_empty() { &start[..] } else { &self.cameras };
        let origin = origin_for(&cameras.iter().map(|(_, camera)| *camera).collect::<Vec<_>>());
        let Packed { geometry, harmonics, lobes, log_scales, degree, with_harmonics } =
            Packed::new(self.scene, origin - self.scene.origin);
        let description = Description {
            base: self.scene.base.len(),
            supplement: self.scene.supplement.as_ref().map_or(0, |s| s.gaussians.len()),
            degree,
            with_harmonics,
            log_scales,
            compensate: self.compensate,
            near: NEAR,
            jacobian_limit: JACOBIAN_LIMIT,
            background: self.background,
            focus: (self.focus.unwrap_or_else(|| middle(self.scene)) - origin).to_array(),
            origin: origin.to_array(),
            cameras: cameras.iter().map(|(name, camera)| shot(name, &camera.around(origin))).collect(),
        };
        let description = serde_json::to_string(&description)
            .map_err(|error| Error::Usage(format!("a camera cannot be written: {error}")))?;
        let longest = 4 * geometry.len().max(harmonics.len()).max(lobes.len()).div_ceil(3) * 4;
        if longest > LONGEST {
            let all = count_of(self.scene);
            let most = all * LONGEST / longest;
            return Err(Error::Usage(format!(
                "the scene has {all} Gaussians, but browsers open pages with at most {most} of its SH degree"
            )));
        }
        let (vertex, fragment) = shaders();
        // A text ends at the first `</script`; after `<!--` it would end elsewhere.
        let description = description.replace('<', "\\u003c");
        let [project, sort, blend, over] = wgsl();
        let fills: [(&str, &str); 15] = [
            ("TITLE", &escape(self.title)),
            ("STYLE", include_str!("viewer/style.css")),
            ("PROJECT", &vertex),
            ("BLEND", &fragment),
            ("OVER_VERT", include_str!("viewer/over.vert")),
            ("OVER_FRAG", include_str!("viewer/over.frag")),
            ("PROJECT_WGSL", &project),
            ("SORT_WGSL", &sort),
            ("BLEND_WGSL", &blend),
            ("OVER_WGSL", &over),
            ("SCRIPTS", SCRIPTS),
            ("GEOMETRY", &text_of(&geometry)),
            ("HARMONICS", &text_of(&harmonics)),
            ("LOBES", &text_of(&lobes)),
            ("SCENE", &description),
        ];
        Ok(fill(include_str!("viewer/page.html"), &fills))
    }
}

const SCRIPTS: &str = concat!(
    include_str!("viewer/scene.js"),
    include_str!("viewer/camera.js"),
    include_str!("viewer/sort.js"),
    include_str!("viewer/draw.js"),
    include_str!("viewer/gpu.js"),
    include_str!("viewer/main.js"),
);

/// Replaces each `{{NAME}}` of `template` in one pass; inserted text is not searched again.
fn fill(template: &str, fills: &[(&str, &str)]) -> String {
    let mut page = String::with_capacity(template.len() + fills.iter().map(|(_, text)| text.len()).sum::<usize>());
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, behind) = after.split_once("}}").unwrap_or((after, ""));
        page += before;
        page += fills.iter().find(|(known, _)| *known == name).map_or("", |(_, text)| text);
        rest = behind;
    }
    page + rest
}

const CONSTANTS: &str = include_str!("../../glsl/shared/constants.glsl");
const SPLAT: &str = include_str!("../../glsl/shared/splat.glsl");
const UNIT: &str = include_str!("../../glsl/shared/unit.glsl");
const HARMONICS: &str = include_str!("../../glsl/shared/harmonics.glsl");

/// Vertex and fragment shader that draw Gaussians. They begin with the code shared with the kernels,
/// without comments.
fn shaders() -> (String, String) {
    let alphas = [part(SPLAT, "const float ALPHA_MIN"), part(SPLAT, "const float ALPHA_MAX")].concat();
    let names = ["const float PI", "const float SH_C0", "const float DILATION"];
    let shared = [
        &names.map(|name| part(CONSTANTS, name)).concat(),
        &alphas,
        UNIT,
        // WebGL has no `precise`.
        &include_str!("../../glsl/shared/trig.glsl").replace("precise ", ""),
        include_str!("../../glsl/shared/view.glsl"),
        include_str!("../../glsl/shared/gaussian.glsl"),
        &part(HARMONICS, "void sh_basis("),
    ]
    .concat();
    (bare(&shared) + include_str!("viewer/project.vert"), bare(&alphas) + include_str!("viewer/blend.frag"))
}

/// WGSL shaders that project, sort, blend, and lay the light over the background.
fn wgsl() -> [String; 4] {
    let lines = [
        (CONSTANTS, &["const uint NONE", "const float PI", "const float SH_C0", "const float DILATION"][..]),
        (SPLAT, &["const float ALPHA_MIN", "const float ALPHA_MAX"]),
        (UNIT, &["const float FLOAT_MIN", "const float FLOAT_MAX"]),
        (include_str!("viewer/project.vert"), &["const float PAD"]),
    ];
    let constants: String =
        lines.iter().flat_map(|(source, names)| names.iter().map(|name| part(source, name))).collect();
    let shared = constants_of_wgsl(&bare(&constants)) + include_str!("viewer/shared.wgsl");
    let basis = basis_of_wgsl(&bare(&part(HARMONICS, "void sh_basis(")));
    [
        [&shared, &basis, include_str!("viewer/project.wgsl")].concat(),
        include_str!("viewer/sort.wgsl").into(),
        [&shared, include_str!("viewer/blend.wgsl")].concat(),
        [&shared, include_str!("viewer/over.wgsl")].concat(),
    ]
}

/// Converts lines `const TYPE NAME = VALUE;` from GLSL to WGSL.
fn constants_of_wgsl(glsl: &str) -> String {
    let line = |line: &str| {
        let types = [("const float ", "f32"), ("const uint ", "u32")];
        let (rest, kind) = types.into_iter().find_map(|(start, kind)| Some((line.strip_prefix(start)?, kind)))?;
        Some(format!("const {}\n", rest.replacen(" = ", &format!(": {kind} = "), 1)))
    };
    glsl.lines().filter_map(line).collect()
}

/// Converts the function `sh_basis` from GLSL to WGSL, which returns the array.
fn basis_of_wgsl(glsl: &str) -> String {
    let signature = "fn sh_basis(d: vec3f) -> array<f32, 16> {\n    var basis: array<f32, 16>;\n";
    let body = glsl.lines().skip(1).map(|line| match line.trim_start().strip_prefix("float ") {
        Some(names) => names.trim_end_matches(';').split(", ").map(|name| format!("    let {name};\n")).collect(),
        None if line == "}" => "    return basis;\n}\n".into(),
        None => line.replace("return;", "{ return basis; }") + "\n",
    });
    signature.to_owned() + &body.collect::<String>()
}

/// Declaration in `source` that begins with `start`: one line, or a whole block if that line opens one.
fn part(source: &str, start: &str) -> String {
    let mut lines = source.lines().skip_while(|line| !line.starts_with(start)).peekable();
    let block = lines.peek().is_some_and(|line| line.ends_with('{'));
    let mut text = String::new();
    for line in lines {
        text += line;
        text.push('\n');
        if !block || line.starts_with('}') {
            break;
        }
    }
    text
}

/// Removes comments, and includes, which only glint's own compiler knows.
fn bare(source: &str) -> String {
    let code = source.lines().filter_map(|line| line.split("//").next()).map(str::trim_end);
    code.filter(|line| !line.is_empty() && !line.starts_with("#include")).flat_map(|line| [line, "\n"]).collect()
}

fn text_of(words: &[u32]) -> String {
    STANDARD.encode(words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())
}

fn shot<'a>(name: &'a str, camera: &Camera) -> Shot<'a> {
    let &Camera { width, height, fx, fy, cx, cy, rotation, translation } = camera;
    let (rotation, translation) = (rotation.transpose().to_cols_array(), translation.to_array());
    Shot { name, width, height, fx, fy, cx, cy, rotation, translation }
}

fn count_of(scene: &Scene) -> usize {
    scene.base.len() + scene.supplement.as_ref().map_or(0, |s| s.gaussians.len())
}

/// Value at the fraction `share` of the sorted values; 0 if there are none.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get((share * values.len() as f64) as usize).copied().unwrap_or(0.0)
}

/// Median of each coordinate.
fn middle(scene: &Scene) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| quantile(scene.world_means().map(|mean| mean[axis]), 0.5)))
}

/// Camera that looks along +z at the middle of the scene and sees most of its Gaussians.
fn overview(scene: &Scene) -> Camera {
    let (width, height) = (960, 720);
    let middle = middle(scene);
    let radius = quantile(scene.world_means().map(|mean| mean.distance(middle)), 0.75).max(NEAR);
    // The vertical field of view is 50°; the ball touches its sides.
    let half = 25f64.to_radians();
    let focal = f64::from(height) / 2.0 / half.tan();
    let eye = middle - DVec3::Z * (radius / half.sin());
    Camera { translation: -eye, ..Camera::new(width, height, focal) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{random_camera, random_scene};

    fn page(title: &str, name: &str) -> String {
        let scene = random_scene(1, 20, 5, 3);
        let cameras = vec![(name, random_camera(64, 48))];
        Viewer { title, scene: &scene, cameras, focus: None, background: [0.0; 3], compensate: false }.page().unwrap()
    }

    #[test]
    fn the_page_is_whole_and_has_no_markup_of_strangers() {
        let html = page("a <b> {{SCENE}}", "</script><script>alert(1)</script>{{TITLE}}");
        assert!(html.contains("<title>a &lt;b&gt; {{SCENE}}</title>") && !html.contains("alert(1)</script>"));
        assert!(html.starts_with("<!DOCTYPE html>") && html.ends_with("</html>\n"));
        // The page loads nothing, and its policy makes the browser enforce that.
        assert!(!html.contains("://") && !html.contains("import ") && html.contains("default-src 'none'"));
        let parts = ["page.html", "style.css", "scene.js", "camera.js", "sort.js", "draw.js", "gpu.js", "main.js"];
        let glsl = ["project.vert", "blend.frag", "over.vert", "over.frag"];
        let wgsl = ["shared.wgsl", "project.wgsl", "sort.wgsl", "blend.wgsl", "over.wgsl"];
        for name in parts.into_iter().chain(glsl).chain(wgsl) {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/report/viewer").join(name);
            assert!(std::fs::read_to_string(path).unwrap().is_ascii(), "{name}");
        }
    }

    #[test]
    fn shaders_have_what_the_kernels_have() {
        let (vertex, fragment) = shaders();
        for name in [
            "const float PI =",
            "const float SH_C0 =",
            "const float DILATION =",
            "const float ALPHA_MIN =",
            "const float FLOAT_MAX =",
            "struct View {",
            "vec3 to_camera(",
            "float to_unit(",
            "vec2 cos_sin(",
            "Projection project_covariance(",
            "Lobe eval_lobe(",
            "void sh_basis(",
        ] {
            assert_eq!(vertex.matches(name).count(), 1, "{name}");
        }
        assert!(fragment.contains("const float ALPHA_MAX =") && !vertex.contains("#include") && vertex.is_ascii());
    }

    #[test]
    fn wgsl_has_the_numbers_of_the_kernels() {
        let [project, sort, blend, over] = wgsl();
        for line in [
            "const NONE: u32 = 0xFFFFFFFFu;",
            "const PI: f32 = 3.14159265358979;",
            "const SH_C0: f32 = 0.28209479177387814;",
            "const DILATION: f32 = 0.3;",
            "const ALPHA_MIN: f32 = 1.0 / 255.0;",
            "const ALPHA_MAX: f32 = 0.99;",
            "const FLOAT_MIN: f32 = 1.17549435e-38;",
            "const FLOAT_MAX: f32 = 3.402823466e38;",
            "const PAD: f32 = 1.0 / 16.0;",
        ] {
            assert!([&project, &blend].iter().all(|text| text.lines().filter(|l| *l == line).count() == 1), "{line}");
        }
        let kernels = part(HARMONICS, "void sh_basis(");
        let values = kernels.lines().filter(|line| line.trim_start().starts_with("basis["));
        assert_eq!(values.clone().count(), 16);
        assert!(values.into_iter().all(|line| project.contains(line)));
        for line in
            ["    let x = d.x;", "    let zz = z * z;", "    if (SH_DEGREE < 3) { return basis; }", "    return basis;"]
        {
            assert!(project.lines().any(|l| l == line), "{line}");
        }
        let all = [project, sort, blend, over].concat();
        assert!(all.is_ascii() && !["float ", "uint ", "TYPE"].iter().any(|word| all.contains(word)));
    }

    #[test]
    fn a_scene_without_cameras_is_seen_from_where_most_of_it_is_in_view() {
        let scene = random_scene(2, 400, 0, 0);
        let camera = overview(&scene);
        let seen = scene.world_means().filter(|&mean| {
            let (x, y, z) = camera.project(mean);
            z > NEAR && (0.0..960.0).contains(&x) && (0.0..720.0).contains(&y)
        });
        assert!(seen.count() >= 300);
        overview(&Scene::default());
    }
}
