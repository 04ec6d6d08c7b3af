//! Opens the pages of `glint export` and `glint report` in a headless browser, and compares the export's
//! pixels with the float64 twin's. Skips if there is no Chromium, unless `GLINT_REQUIRE_CHROMIUM` is set.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use base64::{Engine, engine::general_purpose::STANDARD};
use glint::{
    reference::{self, Background, Options, Params, View, random_camera, random_scene},
    report::viewer::Viewer,
    scene::{Camera, Scene, Supplement},
};
use serde_json::json;
use tempfile::TempDir;

use super::run;

const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

/// With these flags Chromium has WebGPU without a graphics device. Without Vulkan it would have no canvas for
/// it.
const WEBGPU: &[&str] = &[
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
];

/// Its name differs between systems.
fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders).flat_map(|folder| names.map(|name| folder.join(name)));
    let path = found.into_iter().find(|path| path.is_file());
    assert!(path.is_some() || std::env::var_os("GLINT_REQUIRE_CHROMIUM").is_none(), "there is no Chromium");
    if path.is_none() {
        eprintln!("skipped: there is no Chromium");
    }
    path
}

/// The DOM of the page at `path` after loading.
fn loaded(browser: &Path, path: &Path, more: &[&str]) -> String {
    let profile = TempDir::new().unwrap();
    let mut command = Command::new(browser);
    command.args(["--headless", "--no-sandbox", "--disable-gpu-sandbox", "--disable-dev-shm-usage", "--no-first-run"]);
    command.args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-extensions", "--dump-dom"]);
    command.args(more).arg(format!("--user-data-dir={}", profile.path().display()));
    let output = run::run(command.arg(format!("file://{}", path.display())));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The text of the element with this id.
fn text_of<'a>(page: &'a str, id: &str) -> Option<&'a str> {
    let (_, behind) = page.split_once(&format!("id=\"{id}\""))?;
    Some(behind.split_once('>')?.1.split_once('<')?.0)
}

fn pixels(page: &str) -> Vec<u8> {
    let text = text_of(page, "pixels").unwrap_or_else(|| panic!("{:?}", text_of(page, "message")));
    STANDARD.decode(text).unwrap()
}

/// A page with one camera, "a & b.png".
fn page_of(scene: &Scene, camera: &Camera, compensate: bool) -> String {
    let cameras = vec![("a & b.png", *camera)];
    let viewer = Viewer { title: "random", scene, cameras, focus: None, background: BACKGROUND, compensate };
    viewer.page().unwrap()
}

/// The elements with messages, status and pixels of each page, loaded with its hash. All pages are frames of one browser: its start and
/// its shaders take most of a browser's time.
fn framed(browser: &Path, pages: &[(String, String)], more: &[&str]) -> Vec<String> {
    let folder = TempDir::new().unwrap();
    let mut frames = String::new();
    for (i, (page, hash)) in pages.iter().enumerate() {
        fs::write(folder.path().join(format!("{i}.html")), page).unwrap();
        frames += &format!("<iframe src=\"{i}.html#{hash}\"></iframe>");
    }
    // For Chromium, the page has only loaded when its last frame, which is open until then, is closed.
    let collect = "<script>
        const pages = [...document.querySelectorAll('iframe')];
        const open = document.body.appendChild(document.createElement('iframe')).contentDocument;
        open.open();
        const found = frame => ['message', 'status', 'pixels'].map(id => frame.contentDocument.getElementById(id) ?? '');
        const is_done = frame => {
            const [message, status, pixels] = found(frame);
            return !frame.contentWindow.waits && (message.textContent || pixels || status.textContent?.includes('drawn by'));
        };
        const timer = setInterval(() => {
            if (!pages.every(is_done)) return;
            clearInterval(timer);
            for (const frame of pages) document.body.append(document.createElement('hr'), ...found(frame));
            open.close();
        }, 20);
    </script>";
    let path = folder.path().join("all.html");
    fs::write(&path, frames + collect).unwrap();
    let page = loaded(browser, &path, &[more, &["--allow-file-access-from-files"]].concat());
    let found: Vec<String> = page.split("<hr>").skip(1).map(str::to_owned).collect();
    assert_eq!(found.len(), pages.len());
    found
}

/// Loads pages as [`framed`] does; `None` where the test skips.
type Open = fn(&[(String, String)]) -> Option<Vec<String>>;

/// With what Chromium has by default.
fn in_chromium(pages: &[(String, String)]) -> Option<Vec<String>> {
    Some(framed(&chromium()?, pages, &[]))
}

/// With WebGPU; skips if a page is not offered it, unless `GLINT_REQUIRE_CHROMIUM` is set.
fn with_webgpu(pages: &[(String, String)]) -> Option<Vec<String>> {
    let found = framed(&chromium()?, pages, WEBGPU);
    let lacks = found.iter().filter_map(|page| text_of(page, "message")).find(|said| said.contains("not offer"));
    assert!(lacks.is_none() || std::env::var_os("GLINT_REQUIRE_CHROMIUM").is_none(), "{lacks:?}");
    if let Some(said) = lacks {
        eprintln!("skipped: {said}");
        return None;
    }
    Some(found)
}

#[test]
fn webgl_draws_what_the_twin_draws() {
    draws_what_the_twin_draws("webgl2", in_chromium);
}

#[test]
fn webgpu_draws_what_the_twin_draws() {
    draws_what_the_twin_draws("webgpu", with_webgpu);
}

fn draws_what_the_twin_draws(renderer: &str, open: Open) {
    let (mut whole, camera) = (random_scene(41, 1500, 500, 3), random_camera(160, 120));
    let mut cases = Vec::new();
    // Base and supplement may have different bands.
    for (show, precision, compensate, [base, lobed]) in [
        ("both", "half", false, [3, 3]),
        ("base", "float", true, [3, 3]),
        ("supplement", "half", true, [3, 3]),
        ("both", "float", false, [3, 0]),
        ("both", "half", false, [0, 2]),
    ] {
        let mut scene = whole.clone();
        scene.base = scene.base.with_degree(base);
        scene.supplement = scene.supplement.map(|s| Supplement { gaussians: s.gaussians.with_degree(lobed), ..s });
        let hash = format!("camera=a%20%26%20b.png&size=160x120&show={show}&precision={precision}");
        cases.push((hash, scene, show, camera, compensate));
    }
    // Many equal depths, drawn in the order of their indices.
    for (i, mean) in (0..).zip(&mut whole.base.means) {
        *mean = [i % 7, i % 5, i % 3].map(|k| 0.3 * (k as f32 - 2.0));
    }
    cases.push(("size=160x120".into(), whole, "both", camera, false));
    // A camera with its principal point at the picture's left side.
    let half = Camera { width: 80, cx: camera.cx - 80.0, ..camera };
    let hash = "camera=a%20%26%20b.png&size=80x120".into();
    cases.push((hash, random_scene(42, 1500, 0, 0), "both", half, false));

    let pages: Vec<_> = cases
        .iter()
        .map(|(hash, scene, _, camera, compensate)| {
            (page_of(scene, camera, *compensate), format!("{hash}&renderer={renderer}&pixels"))
        })
        .collect();
    let Some(found) = open(&pages) else { return };
    let found: Vec<Vec<u8>> = found.iter().map(|page| pixels(page)).collect();
    for (rgb, (_, scene, show, camera, compensate)) in found.iter().zip(&cases) {
        compare(rgb, scene, show, camera, *compensate);
    }
}

/// Compares 8-bit values with the twin's unrounded ones.
///
/// Rounding to 8 bits alone gives 0.25 on average and at most 0.5. Bytes of the harmonics are off by half of
/// 0.2/127 (`random_scene`'s are at most 0.2): 45 such errors of 0.2/127/√12, times basis functions whose
/// squares sum up to 15/4π, give 0.1 levels. Halves of light are off by 2^-12 at each of the Gaussians that
/// matter, the last ten or so: 0.2 levels at white. Taking α = 1/255 or not is worth its color, a level and
/// a half. The twin stops with a transmittance t of 1e-4 to 0.01 left; the page continues, and the rest is
/// worth t times a color. Colors of this scene are less than 3.
fn compare(rgb: &[u8], scene: &Scene, show: &str, camera: &Camera, compensate: bool) {
    let mut scene = scene.clone();
    match show {
        "base" => scene.supplement = None,
        // An opacity of 2e-9 is invisible.
        "supplement" => scene.base.opacities.fill(-20.0),
        _ => {}
    }
    let params = Params::from_scene(&scene).unwrap();
    let options = Options { compensate, ..Options::default() };
    let background = Background::Color(BACKGROUND.map(f64::from));
    let twin = reference::render(&params, &View::from_camera(camera), &options, background).blended.image;
    assert_eq!(rgb.len(), 3 * twin.len());
    let (mut offs, mut beyond) = (Vec::new(), 0.0f64);
    for (pixel, [r, g, b, t]) in rgb.chunks(3).zip(&twin) {
        let stopped = if *t < 0.01 { 3.0 * 255.0 * t } else { 0.0 };
        for (value, expected) in pixel.iter().zip([r, g, b]) {
            let off = (f64::from(*value) - 255.0 * expected.clamp(0.0, 1.0)).abs();
            offs.push(off);
            beyond = beyond.max(off - stopped);
        }
    }
    offs.sort_by(f64::total_cmp);
    let mean = offs.iter().sum::<f64>() / offs.len() as f64;
    let most = offs[offs.len() * 99 / 100];
    assert!(mean < 0.3 && most < 1.0 && beyond < 2.5, "mean {mean:.3}, 99 % within {most:.3}, all within {beyond:.3}");
}

/// With a quarter of a block for each workgroup, the sort has hundreds of blocks, more than one workgroup scans at once.
#[test]
fn webgpu_sorts_what_is_large_as_webgl_does() {
    let mut scene = random_scene(43, 67_500, 1000, 0);
    scene.base.log_scales.iter_mut().for_each(|scales| *scales = scales.map(|s| s - 2.0));
    let whole = page_of(&scene, &random_camera(160, 120), false);
    let page = whole.replacen("const SORT_BLOCK = 1024;", "const SORT_BLOCK = 256;", 1);
    assert_ne!(page, whole);
    let pages = ["webgl2", "webgpu"].map(|renderer| (page.clone(), format!("size=160x120&renderer={renderer}&pixels")));
    let Some(found) = with_webgpu(&pages) else { return };
    let [webgl, webgpu] = [0, 1].map(|i| pixels(&found[i]));
    let offs: Vec<u8> = webgl.iter().zip(&webgpu).map(|(a, b)| a.abs_diff(*b)).collect();
    let (most, differ) = (offs.iter().max(), offs.iter().filter(|&&off| off > 0).count());
    assert!(webgl.len() == webgpu.len() && most <= Some(&2) && differ < offs.len() / 100, "{most:?}, {differ}");
}

/// Interactive pages with 200 Gaussians must show no message, and must be drawn by the renderers of `cases`: script that runs before
/// the page's own, hash, name of the renderer.
fn drawn_by(cases: &[(&str, &str, &str)], open: Open) {
    let page = page_of(&random_scene(41, 150, 50, 0), &random_camera(160, 120), false);
    let with = |script: &str| page.replacen("<script>", &format!("<script>{script}</script>\n<script>"), 1);
    let pages: Vec<_> = cases.iter().map(|(script, hash, _)| (with(script), (*hash).to_owned())).collect();
    let Some(found) = open(&pages) else { return };
    for (found, (script, hash, name)) in found.iter().zip(cases) {
        let (status, message) = (text_of(found, "status").unwrap(), text_of(found, "message"));
        let drawn: u32 = status.split(' ').next().unwrap().parse().unwrap_or(0);
        assert!(drawn > 0 && status.contains("of 200 Gaussians"), "{script} {hash}: {status:?}, {message:?}");
        assert!(
            status.contains(&format!("drawn by {name}")) && message == Some(""),
            "{script} {hash}: {status} {message:?}"
        );
    }
}

#[test]
fn the_first_frame_waits_for_no_worker() {
    // A worker that never answers.
    drawn_by(&[("window.Worker = class { postMessage() {} };", "", "WebGL2")], in_chromium);
}

#[test]
fn webgpu_is_taken_where_it_is_good_and_webgl_elsewhere() {
    let device = "Object.defineProperty(GPUAdapterInfo.prototype, 'isFallbackAdapter', { value: false });";
    let refused =
        format!("{device} GPUDevice.prototype.createComputePipelineAsync = () => Promise.reject(new Error('no'));");
    let narrow =
        format!("{device} Object.defineProperty(GPUSupportedLimits.prototype, 'maxBufferSize', {{ value: 9000 }});");
    // The device is lost after each of the first frames.
    let lost = |losses: u32| {
        format!(
            "{{
                const made = [], ask = GPUAdapter.prototype.requestDevice, status = document.getElementById('status');
                GPUAdapter.prototype.requestDevice = async function (...how) {{
                    made.push(await ask.apply(this, how));
                    return made.at(-1);
                }};
                window.waits = true;
                new MutationObserver(() => {{
                    window.waits = made.length <= {losses} && status.textContent.includes('WebGPU');
                    if (window.waits) made.at(-1).destroy();
                }}).observe(status, {{ childList: true }});
            }}"
        )
    };
    let cases = [
        (device, "", "WebGPU"),
        (device, "renderer=webgl2", "WebGL2"),
        ("", "renderer=webgpu&show=supplement&precision=float", "WebGPU"),
        // A software device, no device, no room for 200 splats of 48 bytes, a shader that does not compile.
        ("", "", "WebGL2"),
        ("Object.defineProperty(navigator, 'gpu', { value: undefined });", "", "WebGL2"),
        (&narrow, "", "WebGL2"),
        (&refused, "", "WebGL2"),
        // A lost device is asked for once more.
        (&lost(1), "renderer=webgpu", "WebGPU"),
        (&lost(2), "renderer=webgpu", "WebGL2"),
    ];
    drawn_by(&cases, with_webgpu);
}

#[test]
fn what_cannot_be_shown_is_said() {
    let Some(browser) = chromium() else { return };
    let page = page_of(&random_scene(1, 20, 0, 0), &random_camera(16, 12), false);
    let said = |cases: &[(&str, [&str; 2])], more: &[&str]| {
        let pages: Vec<_> = cases.iter().map(|(hash, _)| (page.clone(), (*hash).to_owned())).collect();
        for (found, (hash, words)) in framed(&browser, &pages, more).iter().zip(cases) {
            let said = text_of(found, "message").unwrap();
            assert!(words.iter().all(|word| said.contains(word)), "{hash}: {said}");
        }
    };
    said(&[("size=16x12", ["WebGL2", "not offer"])], &["--disable-3d-apis"]);
    let cases = [
        ("camera=b.png&size=16x12", ["#camera=b.png", "a &amp; b.png"]),
        ("renderer=webgpu", ["#renderer=webgpu", "not offer"]),
        ("size=16x12&renderer=webgpu", ["#renderer=webgpu", "not offer"]),
        ("renderer=canvas", ["#renderer=canvas", "webgpu, webgl2"]),
    ];
    said(&cases, &[]);
}

/// Runs before all scripts of the page, so that it sees their errors.
const COUNT_FAULTS: &str = "<script>window.faults = [];
    addEventListener('error', fault => faults.push(fault.message ?? fault.target.outerHTML.slice(0, 99)), true);
    addEventListener('unhandledrejection', fault => faults.push(String(fault.reason)));
    for (const kind of ['error', 'warn']) console[kind] = (...words) => faults.push(words.join(' '));
</script>";

/// Acts like a reader of the page: waits for all pictures, moves a border, selects another scene. Then opens
/// the page again 400 pixels wide, in a frame, since Chromium's windows are never narrower than 500.
const LOOK_AT_REPORT: &str = "<script>if (top === self) {
    const frame = document.createElement('iframe');
    frame.style = 'width: 400px; height: 800px; border: 0';
    frame.srcdoc = document.documentElement.outerHTML;
    document.body.append(frame);
    addEventListener('load', () => {
        const all = [...document.images], view = document.querySelector('.view');
        const [left, right] = ['.left img', '.right img'].map(side => view.querySelector(side));
        const press = key => document.body.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));
        const over = view.querySelector('.left .over'), range = view.querySelector('.slider input'), select = document.querySelector('.choice select');
        const tables = [...document.querySelectorAll('table')].filter(table => table.tBodies[0].rows.length > 0);
        const shown = all.filter(image => !image.hidden);
        const seen = { pictures: shown.length, broken: shown.filter(image => !image.naturalWidth).length, faults,
            curves: [...document.querySelectorAll('svg')].filter(svg => svg.getBoundingClientRect().height > 50).length,
            sections: [...document.querySelectorAll('h2')].map(head => head.textContent),
            tables: tables.map(table => table.className),
            lost: [...document.querySelectorAll('nav a')].filter(link => !document.querySelector(link.hash)).length,
            asked: performance.getEntriesByType('resource').filter(entry => !entry.name.startsWith('data:')).length };
        range.value = 25;
        range.dispatchEvent(new Event('input'));
        seen.cut = view.querySelector('.left').style.clipPath;
        seen.before = [left.alt, right.alt];
        select.value = '1';
        select.dispatchEvent(new Event('change'));
        seen.after = [left.alt, right.alt];
        seen.over = getComputedStyle(over).display;
        ['e', '+', '+', 'ArrowRight'].forEach(press);
        seen.keys = [over.hidden, over.naturalWidth > 0, left.style.transform, range.value];
        seen.dark = getComputedStyle(document.body).backgroundColor;
        const narrow = frame.contentDocument, width = narrow.documentElement.clientWidth;
        // What scrolls by itself may hold what is wider.
        const parts = [...narrow.querySelectorAll('body *')].filter(one => !one.parentElement.closest('.scroll, .pair, svg, pre'));
        seen.narrow = { faults: frame.contentWindow.faults, window: frame.contentWindow.innerWidth,
            wider: parts.filter(one => one.getBoundingClientRect().right > width + 0.5).map(one => one.outerHTML.slice(0, 99)),
            scrolls: narrow.documentElement.scrollWidth > width };
        document.body.insertAdjacentHTML('beforeend', `<pre id='seen'></pre>`);
        document.getElementById('seen').textContent = JSON.stringify(seen);
    });
}</script>";

/// Scenes of a dataset with known parts, a plan, and a history of two hold-outs.
#[test]
fn the_page_of_a_report_opens_can_be_moved_and_fits_a_narrow_window() {
    let Some(browser) = chromium() else { return };
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let glint = |arguments: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_glint"));
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        command.current_dir(folder.path()).args(arguments.split_whitespace());
        let output = run::run(&mut command);
        assert!(output.status.success(), "glint {arguments}: {}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    glint("synth mixed -o shiny --views 9 --size 24 --points 80");
    fs::write(path("base.json"), glint("train shiny -o base.ply --iterations 60 --sh-degree 1 --json")).unwrap();
    let enhance = "enhance shiny --base base.ply -o augmented.ply --ratio 0.2 --json";
    fs::write(path("augmented.json"), glint(enhance)).unwrap();
    let line = |name: &str, seed: u32, seconds: f64, bytes: u32, holdout: &str| {
        format!(
            r#"{{"name":"{name}","seconds":{seconds},"bytes":{bytes},"gaussians":80,"psnr":{},"ssim":0.7,"seed":{seed},"holdout":"{holdout}","base_psnr":20}}"#,
            20.0 + seconds
        )
    };
    let history = [
        line("base", 0, 1.0, 900, "every"),
        line("base", 1, 1.5, 900, "every"),
        line("augmented", 0, 3.0, 1000, "every"),
        line("augmented", 0, 4.0, 1100, "every"),
        line("augmented", 0, 2.0, 1100, "sector"),
    ];
    fs::write(path("runs.jsonl"), history.join("\n")).unwrap();
    let name = "with_a_name_that_is_longer_than_a_narrow_window_is_wide_and_has_no_space";
    glint(&format!(
        "report shiny base=base.ply {name}=augmented.ply -o page --history runs.jsonl --run base.json --run augmented.json"
    ));
    let html = fs::read_to_string(path("page/index.html")).unwrap();
    let html = html.replacen("<head>", &format!("<head>{COUNT_FAULTS}"), 1);
    // In any folder.
    fs::write(path("elsewhere.html"), html.replacen("</body>", &format!("{LOOK_AT_REPORT}</body>"), 1)).unwrap();
    let page = loaded(&browser, &path("elsewhere.html"), &["--blink-settings=preferredColorScheme=0"]);
    let (_, seen) = page.split_once("<pre id=\"seen\">").unwrap();
    let seen = seen.split_once("</pre>").unwrap().0.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let seen: serde_json::Value = serde_json::from_str(&seen).unwrap();
    // For both views: two pictures under the slider, the photograph and its true parts, and for both scenes a
    // render, an error and parts.
    assert_eq!(
        (&seen["pictures"], &seen["broken"], &seen["asked"], &seen["lost"]),
        (&26.into(), &0.into(), &0.into(), &0.into()),
        "{seen}"
    );
    assert_eq!((&seen["faults"], &seen["narrow"]["faults"]), (&json!([]), &json!([])), "{seen}");
    // PSNR and SSIM over seconds and bytes, for the one hold-out with several evaluations of a run.
    assert_eq!(seen["curves"], 4, "{seen}");
    let plan = format!("Plan of {name}");
    let expected = [
        "2 views",
        "Scenes",
        "Work and precision: hold-out every",
        "Work and precision: hold-out sector",
        &plan,
        "Time and memory",
    ];
    assert_eq!(seen["sections"], json!(expected), "{seen}");
    assert_eq!(
        seen["tables"],
        json!(["pictures", "pictures", "scenes", "views", "ends", "ends", "took", "stages"]),
        "{seen}"
    );
    assert_eq!(seen["cut"], "inset(0px 75% 0px 0px)", "{seen}");
    let alt = |key: &str, side: usize| seen[key][side].as_str().unwrap().to_owned();
    // First the photograph next to the last scene; then the base next to it.
    assert!(alt("before", 0).contains("photo") && alt("before", 1).contains(name), "{seen}");
    assert!(alt("after", 0).contains("base") && alt("after", 1) == alt("before", 1), "{seen}");
    // The reader's dark theme.
    assert_eq!(seen["dark"], "rgb(24, 24, 24)", "{seen}");
    // No errors at first; then they are shown, pictures are enlarged by two keys, and another moves the border.
    assert_eq!(seen["over"], "none", "{seen}");
    assert_eq!(seen["keys"], json!([false, true, "scale(4)", "30"]), "{seen}");
    let narrow = &seen["narrow"];
    assert_eq!(
        (&narrow["window"], &narrow["wider"], &narrow["scrolls"]),
        (&400.into(), &json!([]), &false.into()),
        "{seen}"
    );
}
