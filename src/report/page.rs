//! HTML page of `glint report`: compares scenes of one dataset in a single self-contained file.

use std::fmt::Write;

use serde::Serialize;

use super::decompose::PartsQuality;
use super::history::{Cost, Curve, Gain, Range, Record, css_color, curves, holdouts, plot};
use super::html::{escape, scrolling};
use super::metrics::Quality;
use super::runs::{self, Run};
use super::spending;
use crate::Result;

/// Brightness factor for pictures of specular light, most of which would be too dark to see.
pub const SPECULAR_GAIN: f32 = 4.0;

/// Scene on the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    /// Name on the page.
    pub name: String,
    /// Gaussians of base and supplement.
    pub gaussians: usize,
    /// Gaussians of the supplement.
    pub supplementary: usize,
    /// Size of its file, bytes.
    pub bytes: u64,
    /// Mean quality over the views.
    #[serde(flatten)]
    pub mean: Quality,
    /// Mean quality of its light's parts, if the true ones are known.
    #[serde(rename = "decomposition", skip_serializing_if = "Option::is_none")]
    pub parts: Option<PartsQuality>,
    /// Views in the order of the page's photos.
    pub views: Vec<EntryView>,
}

/// View of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EntryView {
    /// Name of the photo, without extension.
    pub name: String,
    /// PSNR and SSIM.
    #[serde(flatten)]
    pub quality: Quality,
    /// Quality of its light's parts, if the true ones are known.
    #[serde(rename = "decomposition", skip_serializing_if = "Option::is_none")]
    pub parts: Option<PartsQuality>,
    /// Pictures as `data:` addresses, each with its content: `render`, `error`, and if light is shown in
    /// parts `diffuse` and `specular`, the latter brightened by [`SPECULAR_GAIN`].
    #[serde(skip)]
    pub pictures: Vec<(&'static str, String)>,
}

/// Photo and true parts of a view, as `data:` addresses.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Photo.
    pub photo: String,
    /// True diffuse and specular light, if known; the latter brightened by [`SPECULAR_GAIN`].
    pub parts: Option<[String; 2]>,
}

/// Writes the page. `title` names scenes and dataset. Every entry has the views of `truths`, in their
/// order. Gains are over the first entry. Curves are drawn from `history`; `told` holds the reports of
/// runs.
///
/// # Errors
/// If curves cannot be drawn.
pub fn page(title: &str, truths: &[Truth], entries: &[Entry], history: &[Record], told: &[Run]) -> Result<String> {
    let title = escape(title);
    let mut pictures = entries.iter().flat_map(|entry| &entry.views).flat_map(|view| &view.pictures);
    let in_parts = truths.iter().any(|truth| truth.parts.is_some()) || pictures.any(|(what, _)| *what == "diffuse");
    let mut explained = EXPLAINED.to_owned();
    if in_parts {
        let _ =
            write!(explained, " {PARTS_EXPLAINED} Specular light is shown {SPECULAR_GAIN} times as bright as it is.");
    }
    let seen = format!("{} view{}", truths.len(), if truths.len() == 1 { "" } else { "s" });
    let mut sections = vec![("views", seen, views(truths, entries, in_parts))];
    sections.push(("scenes", "Scenes".to_owned(), table_of_scenes(entries) + &table_of_views(entries)));
    for (k, holdout) in holdouts(history).into_iter().enumerate() {
        let head = format!("Work and precision: hold-out {}", escape(holdout));
        sections.push((if k == 0 { "work" } else { "" }, head, work_precision(&curves(history, holdout))?));
    }
    for Run { name, plan, .. } in told {
        sections.extend(plan.as_ref().map(|plan| ("", format!("Plan of {}", escape(name)), spending::html(plan))));
    }
    sections.extend(runs::html(told).map(|took| ("took", "Time and memory".to_owned(), took)));
    let (mut links, mut body) = (String::new(), String::new());
    for (id, head, content) in sections {
        let mut named = String::new();
        if !id.is_empty() {
            named = format!(" id=\"{id}\"");
            let _ = write!(links, "<a href=\"#{id}\">{}</a> ", head.split(':').next().unwrap_or(&head));
        }
        let _ = write!(body, "<h2{named}>{head}</h2>\n{content}");
    }
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head><body><h1>{title}</h1>\n\
         <nav>{links}</nav>\n{body}<p>{explained}</p>\n<script>{SCRIPT}</script></body></html>\n"
    ))
}

const EXPLAINED: &str = "PSNR and SSIM compare renders, not quantized and clamped to between 0 and 1, with the \
    photos; a mask leaves out gray pixels. Errors are means over the channels, from 0 (dark) to 0.25 and more (pale).";

const PARTS_EXPLAINED: &str = "Diffuse light comes from the base's constant colors; specular light is the rest. If the \
    true parts are known, PSNR of both in linear light is given.";

/// Tables wider than the window have their own scroll bar, with a fixed first column. Colors follow the reader's light or dark theme; plots
/// stay light. Printed pages have no controls.
pub(super) const STYLE: &str = ":root{color-scheme:light dark;--back:#fff;--text:#222;--dim:#555;--line:#ddd}\
    @media(prefers-color-scheme:dark){:root{--back:#181818;--text:#ddd;--dim:#aaa;--line:#444}}\
    body{font:15px/1.4 system-ui,sans-serif;margin:2rem;color:var(--text);background:var(--back)}h1{font-size:1.3rem}\
    h2{font-size:1.1rem;margin-top:2rem}h3{font-size:1rem}p{max-width:60rem;color:var(--dim)}table{border-collapse:collapse}\
    th,td{padding:.3rem .6rem;text-align:right;vertical-align:top;border-bottom:1px solid var(--line);font-variant-numeric:tabular-nums}\
    th{white-space:nowrap}th.picture,td:first-child,th:first-child{text-align:left}tfoot td{font-weight:600;border-top:2px solid #888}\
    img{display:block;max-width:400px;height:auto}a{color:inherit}\
    h1,h2,h3,.scroll td:first-child{overflow-wrap:anywhere}.scroll td:first-child{min-width:6rem}nav a{margin-right:1rem}.scroll{overflow-x:auto;\
    margin-bottom:1rem}.scroll th:first-child,.scroll td:first-child{position:sticky;left:0;background:var(--back)}\
    .view{display:flex;flex-wrap:wrap;gap:1rem 1.5rem;align-items:flex-start;border-top:1px solid var(--line);padding:1rem 0;\
    scroll-margin-top:3rem}.view h3{flex-basis:100%;margin:0}.slider{width:min(640px,100%)}\
    .pair{position:relative;overflow:hidden;line-height:0;cursor:ew-resize;touch-action:pan-y;user-select:none}\
    .side{isolation:isolate;overflow:hidden}.side.left,.over{position:absolute;inset:0}.side img{width:100%;max-width:none}\
    .over{mix-blend-mode:screen}[hidden]{display:none}.slider input{width:100%;margin:.4rem 0}.view .scroll{flex:1 1 640px;min-width:0;\
    margin:0}.view td img{width:clamp(80px,8vw,160px)}img.small{image-rendering:pixelated}\
    .score{display:block;font-size:.85em;text-align:left}.choice{position:sticky;top:0;background:var(--back);padding:.5rem 0;margin:0;z-index:1}\
    .choice label{display:inline-block;margin-right:1rem}.choice select{max-width:60vw}\
    .curves{display:flex;flex-wrap:wrap;gap:.5rem}.curves svg{max-width:100%;height:auto;background:#fff}pre.plan{overflow-x:auto}\
    summary{cursor:pointer;color:var(--dim)}.key{display:inline-block;width:.9em;height:.9em;margin-right:.4em}\
    .views th{white-space:normal}\
    @media(max-width:700px){body{margin:1rem;font-size:13px}th,td{padding:.25rem .4rem}}\
    @media print{nav,.choice,.slider input,.hint{display:none}.scroll{overflow:visible}.slider{width:20rem}.slider,tr,.curves svg{break-inside:avoid}}";

const HINT: &str = "Drag across a picture to move the border, double-click to enlarge. Keys: ← → border, + − size, e errors, \
    j k next and previous view.";

/// Shows the two selected pictures in every view, with a movable border between them. Keys act on the view that was used last.
const SCRIPT: &str = "const views=[...document.querySelectorAll('.view')],choice=[...document.querySelectorAll('.choice select')],\
    errors=document.querySelector('.choice input');let now=0;\
    const show=()=>views.forEach(view=>{const rows=[...view.querySelectorAll('tbody tr')];\
    ['left','right'].forEach((side,i)=>{const row=rows[choice[i].value],[image,over]=view.querySelectorAll(`.${side} img`),\
    shot=row.querySelector('.shot'),error=row.querySelector('.error');\
    image.src=shot.src;image.alt=shot.alt;image.classList.toggle('small',shot.classList.contains('small'));\
    over.hidden=!errors.checked||!error;if(error)over.src=error.src})});\
    const cut=(view,to)=>{const range=view.querySelector('.slider input');if(to!==undefined)range.value=to;\
    view.querySelector('.left').style.clipPath=`inset(0 ${100-range.value}% 0 0)`};\
    const size=(view,times,x=50,y=50)=>{const old=+view.dataset.size||1,k=Math.min(16,Math.max(1,old*times));view.dataset.size=k;\
    view.querySelectorAll('.side img').forEach(image=>{if(old===1)image.style.transformOrigin=`${x}% ${y}%`;\
    image.style.transform=k>1?`scale(${k})`:''})};\
    views.forEach((view,i)=>{const pair=view.querySelector('.pair'),range=view.querySelector('.slider input');range.oninput=()=>cut(view);cut(view);\
    const at=event=>{const box=pair.getBoundingClientRect();return[(event.clientX-box.x)/box.width*100,(event.clientY-box.y)/box.height*100]};\
    view.onpointerdown=()=>{now=i};pair.onpointermove=event=>{if(event.buttons)cut(view,at(event)[0])};\
    pair.ondblclick=event=>size(view,(+view.dataset.size||1)<4?4:1/16,...at(event));pair.ondragstart=()=>false});\
    choice[1].value=choice[1].options.length-1;[...choice,errors].forEach(input=>input.onchange=show);show();\
    document.onkeydown=event=>{if(event.target.matches('select,input')||event.ctrlKey||event.metaKey||event.altKey)return;\
    const view=views[now],step={ArrowLeft:-5,ArrowRight:5}[event.key],times={'+':2,'-':.5}[event.key],go={j:1,k:-1}[event.key];\
    if(step)cut(view,+view.querySelector('.slider input').value+step);else if(times)size(view,times);\
    else if(event.key==='e'){errors.checked=!errors.checked;show()}\
    else if(go){now=Math.min(views.length-1,Math.max(0,now+go));views[now].scrollIntoView()}else return;event.preventDefault()};";

fn table_of_scenes(entries: &[Entry]) -> String {
    // A single scene has no other to gain over.
    let first = entries.first().filter(|_| entries.len() > 1);
    let judged = entries.iter().any(|entry| entry.parts.is_some());
    let mut table =
        "<thead><tr><th>scene</th><th>Gaussians</th><th>with lobes</th><th>bytes</th><th>PSNR [dB]</th>".to_owned();
    if let Some(first) = first {
        let _ = write!(table, "<th>over {} [dB]</th>", escape(&first.name));
    }
    table += "<th>SSIM</th>";
    if judged {
        table += "<th>diffuse PSNR [dB]</th><th>specular PSNR [dB]</th>";
    }
    table += "</tr></thead>\n<tbody>";
    for (k, Entry { name, gaussians, supplementary, bytes, mean, parts, .. }) in entries.iter().enumerate() {
        let name = escape(name);
        let _ = write!(table, "<tr><td>{name}</td><td>{gaussians}</td><td>{supplementary}</td><td>{bytes}</td>");
        let _ = write!(table, "<td>{}</td>", decibels(mean.psnr));
        if let Some(first) = first {
            // The difference of two infinite values has no meaning.
            let gain = Some(mean.psnr - first.mean.psnr).filter(|gain| k > 0 && gain.is_finite());
            let _ = write!(table, "<td>{}</td>", gain.map_or_else(String::new, |gain| format!("{gain:+.2}")));
        }
        let _ = write!(table, "<td>{:.4}</td>", mean.ssim);
        if judged {
            let score = |of: fn(&PartsQuality) -> f64| parts.as_ref().map_or_else(String::new, |q| decibels(of(q)));
            let _ = write!(table, "<td>{}</td><td>{}</td>", score(|q| q.diffuse), score(|q| q.specular));
        }
        table += "</tr>\n";
    }
    scrolling("scenes", &(table + "</tbody>"))
}

fn table_of_views(entries: &[Entry]) -> String {
    let mut table = "<thead><tr><th>view</th>".to_owned();
    for entry in entries {
        let name = escape(&entry.name);
        let _ = write!(table, "<th>{name} PSNR [dB]</th><th>{name} SSIM</th>");
    }
    table += "</tr></thead>\n<tbody>";
    let count = entries.first().map_or(0, |entry| entry.views.len());
    for i in 0..count {
        let _ = write!(table, "<tr><td>{}</td>", escape(&entries[0].views[i].name));
        entries.iter().for_each(|entry| table += &cells(&entry.views[i].quality));
        table += "</tr>\n";
    }
    table += "</tbody><tfoot><tr><td>mean</td>";
    entries.iter().for_each(|entry| table += &cells(&entry.mean));
    scrolling("views", &(table + "</tr></tfoot>"))
}

/// Table of the ends of a hold-out's curves, and plots over those costs that change within some run.
fn work_precision(curves: &[Curve<'_>]) -> Result<String> {
    let over_base = |record: &Record| record.base_psnr.map(|base| record.psnr - base);
    let known = curves.iter().any(|curve| curve.last(over_base).is_some());
    let mut table = "<thead><tr><th>run, at its end</th><th>seeds</th><th>seconds</th><th>bytes</th><th>Gaussians</th>\
                     <th>PSNR [dB]</th>"
        .to_owned();
    if known {
        table += "<th>over its base [dB]</th>";
    }
    table += "<th>SSIM</th></tr></thead>\n<tbody>";
    let text = |range: Option<Range>, show: &dyn Fn(f64) -> String| match range {
        None => String::new(),
        Some(Range { mean, least, largest }) if least == largest => show(mean),
        Some(Range { mean, least, largest }) => format!("{} ({} to {})", show(mean), show(least), show(largest)),
    };
    for (k, curve) in curves.iter().enumerate() {
        let (color, name) = (css_color(k), escape(curve.name));
        let key = format!("<span class=\"key\" style=\"background:{color}\"></span>");
        let _ = write!(table, "<tr><td>{key}{name}</td><td>{}</td>", curve.seeds.len());
        let mut cell = |of: &dyn Fn(&Record) -> Option<f64>, show: &dyn Fn(f64) -> String| {
            let _ = write!(table, "<td>{}</td>", text(curve.last(of), show));
        };
        cell(&|r| Some(r.seconds), &|v| format!("{v:.1}"));
        cell(&|r| Some(r.bytes as f64), &|v| format!("{v:.0}"));
        cell(&|r| Some(r.gaussians as f64), &|v| format!("{v:.0}"));
        cell(&|r| Some(r.psnr), &|v| format!("{v:.2}"));
        if known {
            cell(&over_base, &|v| format!("{v:+.2}"));
        }
        cell(&|r| Some(r.ssim), &|v| format!("{v:.4}"));
        table += "</tr>\n";
    }
    let mut out = scrolling("ends", &(table + "</tbody>"));
    let (drawn, left): (Vec<Cost>, Vec<Cost>) =
        Cost::ALL.into_iter().partition(|&cost| curves.iter().any(|curve| curve.goes_over(cost)));
    if !left.is_empty() {
        let left: Vec<&str> = left.into_iter().map(Cost::title).collect();
        let _ = writeln!(out, "<p>No plot over {}: no run has more than one value.</p>", left.join(" or "));
    }
    if drawn.is_empty() {
        return Ok(out);
    }
    out += "<p>A curve connects measurements during a run, or runs of several lengths. Pale lines are seeds, \
            strong lines the means of their k-th measurements, bars minimum and maximum.</p>\n<div class=\"curves\">";
    for (gain, &cost) in Gain::ALL.into_iter().flat_map(|gain| drawn.iter().map(move |cost| (gain, cost))) {
        out += &plot(curves, cost, gain)?;
    }
    Ok(out + "</div>\n")
}

/// Sliders of all views. `in_parts` adds columns for the parts of light.
fn views(truths: &[Truth], entries: &[Entry], in_parts: bool) -> String {
    let names = std::iter::once("photo".to_owned()).chain(entries.iter().map(|entry| escape(&entry.name)));
    let options: String = names.enumerate().map(|(i, name)| format!("<option value=\"{i}\">{name}</option>")).collect();
    let mut out = format!(
        "<p class=\"hint\">{HINT}</p><p class=\"choice\"><label>left <select>{options}</select></label><label>right \
         <select>{options}</select></label><label><input type=\"checkbox\"> errors</label></p>\n"
    );
    for (i, truth) in truths.iter().enumerate() {
        out += &view(i, truth, entries, in_parts);
    }
    out
}

/// Slider of one view, with a row for the photo and one for each scene; see [`views`].
fn view(i: usize, truth: &Truth, entries: &[Entry], in_parts: bool) -> String {
    let name = entries.first().map_or_else(String::new, |entry| escape(&entry.views[i].name));
    let image = |class: &str, what: &str, source: &str| {
        // Small pictures show their pixels when enlarged.
        let small = if source.starts_with("data:image/png") { " small" } else { "" };
        format!("<img class=\"{class}{small}\" alt=\"{what} of {name}\" src=\"{source}\">")
    };
    let mut table = "<thead><tr><th></th><th>PSNR [dB]</th><th>SSIM</th><th class=\"picture\">picture</th>\
                     <th class=\"picture\">error</th>"
        .to_owned();
    if in_parts {
        let _ =
            write!(table, "<th class=\"picture\">diffuse</th><th class=\"picture\">specular × {SPECULAR_GAIN}</th>");
    }
    let _ = write!(
        table,
        "</tr></thead>\n<tbody><tr><td>photo</td><td></td><td></td><td>{}</td><td></td>",
        image("shot", "photo", &truth.photo)
    );
    if in_parts {
        for (k, what) in ["diffuse", "specular"].into_iter().enumerate() {
            let shown = truth.parts.as_ref().map(|parts| image("part", &format!("true {what}"), &parts[k]));
            let _ = write!(table, "<td>{}</td>", shown.unwrap_or_default());
        }
    }
    table += "</tr>\n";
    for entry in entries {
        let EntryView { quality, pictures, parts, .. } = &entry.views[i];
        let scene = escape(&entry.name);
        let _ = write!(table, "<tr><td>{scene}</td>{}", cells(quality));
        let mut picture = |what: &str, class: &str, score: Option<f64>| {
            let found = pictures.iter().find(|(name, _)| *name == what);
            let shown = found.map_or_else(String::new, |(_, source)| image(class, &format!("{scene}: {what}"), source));
            let score = score.map(|psnr| format!("<span class=\"score\">{} dB</span>", decibels(psnr)));
            let _ = write!(table, "<td>{shown}{}</td>", score.unwrap_or_default());
        };
        picture("render", "shot", None);
        picture("error", "error", None);
        if in_parts {
            picture("diffuse", "part", parts.map(|q| q.diffuse));
            picture("specular", "part", parts.map(|q| q.specular));
        }
        table += "</tr>\n";
    }
    let side =
        |name: &str| format!("<div class=\"side {name}\"><img alt=\"\"><img class=\"over\" alt=\"\" hidden></div>");
    format!(
        "<section class=\"view\"><h3>{name}</h3><div class=\"slider\"><div class=\"pair\">{}{}</div><input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"border\"></div>\n{}\
         </section>\n",
        side("right"),
        side("left"),
        scrolling("pictures", &(table + "</tbody>"))
    )
}

fn cells(quality: &Quality) -> String {
    format!("<td>{}</td><td>{:.4}</td>", decibels(quality.psnr), quality.ssim)
}

fn decibels(psnr: f64) -> String {
    if psnr.is_finite() { format!("{psnr:.2}") } else { "Infinity".into() }
}

#[cfg(test)]
mod tests {
    use super::super::pictures::data_of;
    use super::*;

    fn entry(name: &str, psnr: f64, parts: bool) -> Entry {
        let quality = Quality { psnr, ssim: 0.5 };
        let picture = |color| data_of(&image::RgbImage::from_pixel(8, 6, image::Rgb(color))).unwrap();
        let mut pictures = vec![("render", picture([9, 9, 9])), ("error", picture([200, 0, 0]))];
        if parts {
            pictures.extend([("diffuse", picture([0, 200, 0])), ("specular", picture([0, 0, 200]))]);
        }
        let view = |name: &str| EntryView { name: name.into(), quality, parts: None, pictures: pictures.clone() };
        let views = vec![view("one<i>"), view("two")];
        Entry { name: name.into(), gaussians: 7, supplementary: 2, bytes: 1234, mean: quality, parts: None, views }
    }

    #[test]
    fn a_page_has_every_scene_view_and_curve_once_and_nothing_of_the_net() {
        let truths = [[1, 2, 3], [4, 5, 6]].map(truth);
        let record = |name: &str, seed, seconds: f64, holdout: &str| Record {
            name: name.into(),
            seconds,
            bytes: 100,
            gaussians: 5,
            psnr: 20.0 + seconds,
            ssim: 0.7,
            seed,
            holdout: holdout.into(),
            base_psnr: (name == "plain").then_some(21.5),
        };
        let history = [
            record("<u>", 0, 1.0, "every"),
            record("<u>", 1, 3.0, "every"),
            record("<u>", 0, 2.0, "every"),
            record("<u>", 1, 5.0, "every"),
            record("plain", 0, 2.0, "every"),
            record("plain", 0, 2.0, "sector"),
        ];
        let run = Run { name: "more<b>".into(), phases: vec![("training".into(), 1.0)], ..Run::default() };
        let entries = [entry("base", 20.125, false), entry("more<b>", f64::INFINITY, true)];
        let html = page("a & b", &truths, &entries, &history, &[run]).unwrap();
        let count = |part: &str| html.matches(part).count();
        assert!(html.contains("<title>a &amp; b</title>") && !html.contains("://"));
        assert_eq!([count("<b>"), count("<i>"), count("<u>")], [0; 3]);
        assert_eq!((count("<section"), count("type=\"range\""), count("<select>")), (2, 2, 2));
        assert_eq!(count("<option value=\"2\">more&lt;b&gt;</option>"), 2);
        // Photos are large, all other pictures small.
        assert_eq!((count("data:image/jpeg"), count("data:image/png")), (2, 12));
        assert_eq!(
            [count("No plot over bytes or Gaussians"), count("No plot over seconds or bytes or Gaussians")],
            [1; 2]
        );
        assert!(html.contains("<td>7</td><td>2</td><td>1234</td>"));
        assert!(html.contains("<td>22.00</td><td>+0.50</td><td>0.7000</td>"), "what is gained over the base");
        assert!(html.contains("<td>mean</td><td>20.12</td><td>0.5000</td><td>Infinity</td><td>0.5000</td>"));
        // Pictures come first.
        let [scenes, work, views, took] = ["scenes", "work", "views", "took"].map(|id| {
            assert_eq!(count(&format!("href=\"#{id}\"")), 1, "{id}");
            html.find(&format!("<h2 id=\"{id}\">")).unwrap()
        });
        assert!(views < scenes && scenes < work && work < took, "{html}");
        let without = page("x", &truths, &[entry("base", 20.0, false)], &[], &[]).unwrap();
        assert!(!without.contains("<svg") && !without.contains("Work and precision"));
        assert!(!without.contains("over base") && !without.to_lowercase().contains("diffuse"), "{without}");
    }

    #[test]
    fn gains_are_over_the_first_scene() {
        let entries = [("base", 20.0), ("worse", 19.5), ("better", 24.0)].map(|(name, psnr)| entry(name, psnr, false));
        let html = page("x", &[[1, 2, 3], [4, 5, 6]].map(truth), &entries, &[], &[]).unwrap();
        let parts = ["over base [dB]", "<td>-0.50</td>", "<td>+4.00</td>"];
        assert_eq!(parts.map(|part| html.matches(part).count()), [1; 3], "{html}");
    }

    fn truth(color: [u8; 3]) -> Truth {
        let photo = data_of(&image::RgbImage::from_pixel(300, 20, image::Rgb(color))).unwrap();
        Truth { photo, parts: None }
    }
}
