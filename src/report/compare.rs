//! Several scenes of one dataset on one HTML page that needs nothing beside it.

use std::fmt::Write;

use serde::Serialize;

use super::history::{Cost, Gain, Range, Record, css_color, curves, holdouts, plot};
use super::metrics::Quality;
use super::page::{STYLE, cells, escape};
use super::runs::{self, Run};
use crate::Result;

/// One of the scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    /// As the page shows it.
    pub name: String,
    /// Base and supplement.
    pub gaussians: usize,
    /// See `gaussians`.
    pub supplementary: usize,
    /// Of its file.
    pub bytes: u64,
    /// Means over the views.
    #[serde(flatten)]
    pub mean: Quality,
    /// In the order of the page's photos.
    pub views: Vec<EntryView>,
}

/// One of the scenes in one view.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EntryView {
    /// The photo's, without extension.
    pub name: String,
    /// PSNR and SSIM.
    #[serde(flatten)]
    pub quality: Quality,
    /// What each picture shows, and the picture as a `data:` address: `render`, `error`, and of an augmented scene `diffuse` and
    /// `specular`.
    #[serde(skip)]
    pub pictures: Vec<(&'static str, String)>,
}

/// The page. `title` says what was compared with what, `photos` has each view's photograph as a `data:` address; every entry has
/// these views, in their order. Without `history` there are no curves;
/// `told` is what runs said of themselves.
///
/// # Errors
/// Where curves cannot be drawn.
pub fn page(title: &str, photos: &[String], entries: &[Entry], history: &[Record], told: &[Run]) -> Result<String> {
    let title = escape(title);
    let mut body = format!("<h1>{title}</h1>\n<p>{EXPLAINED}</p>\n<h2>Scenes</h2>\n");
    body += &table_of_scenes(entries);
    for holdout in holdouts(history) {
        body += &work_precision(history, holdout)?;
    }
    body += &runs::html(told);
    let _ = write!(body, "<h2>{} views</h2>\n{}", photos.len(), table_of_views(entries));
    let names = || std::iter::once("photo".to_owned()).chain(entries.iter().map(|entry| escape(&entry.name)));
    let options: String =
        names().enumerate().map(|(i, name)| format!("<option value=\"{i}\">{name}</option>")).collect();
    let _ = writeln!(
        body,
        "<p class=\"choice\"><label>left <select>{options}</select></label> <label>right <select>{options}</select></label></p>"
    );
    for (i, photo) in photos.iter().enumerate() {
        body += &view(i, photo, entries);
    }
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n<style>{STYLE}{OWN_STYLE}</style>\n\
         </head><body>{body}<script>{SCRIPT}</script></body></html>\n"
    ))
}

const EXPLAINED: &str = "PSNR and SSIM are of unquantised renders, clamped to 0 to 1, against the photographs; grey pixels are left \
    out by a mask. Errors are means over the channels, from 0 (dark) to 0.25 and more (pale). Diffuse is what the base's constant \
    colours give, specular the rest of the light. The slider under a view moves the border between the left and the right picture.";

/// What the page has beside [`STYLE`].
const OWN_STYLE: &str = "h2{font-size:1.1rem;margin-top:2rem}h3{font-size:1rem}table{margin-bottom:1rem}.view{display:flex;\
    flex-wrap:wrap;gap:1.5rem;align-items:flex-start;border-top:1px solid #ccc;padding:1rem 0}.view h3{flex-basis:100%;margin:0}\
    .slider{width:400px}.pair{position:relative;line-height:0}.pair img{width:400px}.pair .left{position:absolute;left:0;top:0}\
    .slider input{width:400px;margin:.4rem 0}.view td img,.view th img{width:160px}img.small{image-rendering:pixelated}\
    .choice{position:sticky;top:0;background:#fff;padding:.5rem 0;z-index:1}.curves{display:flex;flex-wrap:wrap}\
    .key{display:inline-block;width:.9em;height:.9em;margin-right:.4em}th{position:static;cursor:default}.views th{white-space:normal}";

/// The two pictures that are chosen, in every view, and the border between them.
const SCRIPT: &str = "const views=[...document.querySelectorAll('.view')],choice=[...document.querySelectorAll('.choice select')];\
    const show=()=>views.forEach(view=>{const shots=view.querySelectorAll('.shot');\
    ['left','right'].forEach((side,i)=>{const shot=shots[choice[i].value],image=view.querySelector('.'+side);\
    image.src=shot.src;image.alt=shot.alt;image.classList.toggle('small',shot.classList.contains('small'))})});\
    views.forEach(view=>{const range=view.querySelector('input'),left=view.querySelector('.left');\
    const cut=()=>left.style.clipPath=`inset(0 ${100-range.value}% 0 0)`;range.oninput=cut;cut()});\
    choice[1].value=choice[1].options.length-1;choice.forEach(select=>select.onchange=show);show();";

fn table_of_scenes(entries: &[Entry]) -> String {
    let mut table =
        "<table class=\"scenes\"><thead><tr><th>scene</th><th>Gaussians</th><th>with lobes</th><th>bytes</th>\
         <th>PSNR [dB]</th><th>SSIM</th></tr></thead>\n<tbody>"
            .to_owned();
    for Entry { name, gaussians, supplementary, bytes, mean, .. } in entries {
        let _ = writeln!(
            table,
            "<tr><td>{}</td><td>{gaussians}</td><td>{supplementary}</td><td>{bytes}</td>{}</tr>",
            escape(name),
            cells(mean)
        );
    }
    table + "</tbody></table>\n"
}

fn table_of_views(entries: &[Entry]) -> String {
    let mut table = "<table class=\"views\"><thead><tr><th>view</th>".to_owned();
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
    table + "</tr></tfoot></table>\n"
}

/// The curves of one hold-out, and where they end.
fn work_precision(history: &[Record], holdout: &str) -> Result<String> {
    let curves = curves(history, holdout);
    let mut out = format!(
        "<h2>Work and precision: hold-out {}</h2>\n<table class=\"ends\"><thead><tr><th>run, at its end</th><th>seeds</th><th>seconds\
         </th><th>bytes</th><th>Gaussians</th><th>PSNR [dB]</th><th>SSIM</th></tr></thead>\n<tbody>",
        escape(holdout)
    );
    let text = |range: Option<Range>, decimals: usize| match range {
        None => String::new(),
        Some(Range { mean, least, largest }) if least == largest => format!("{mean:.decimals$}"),
        Some(Range { mean, least, largest }) => {
            format!("{mean:.decimals$} ({least:.decimals$} to {largest:.decimals$})")
        }
    };
    for (k, curve) in curves.iter().enumerate() {
        let _ = writeln!(
            out,
            "<tr><td><span class=\"key\" style=\"background:{}\"></span>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
             <td>{}</td></tr>",
            css_color(k),
            escape(curve.name),
            curve.seeds.len(),
            text(curve.last(|r| r.seconds), 1),
            text(curve.last(|r| r.bytes as f64), 0),
            text(curve.last(|r| r.gaussians as f64), 0),
            text(curve.last(|r| r.psnr), 2),
            text(curve.last(|r| r.ssim), 4),
        );
    }
    out += "</tbody></table>\n<p>Pale lines are seeds, strong ones the means of their measurements by number, bars the least and the \
            largest.</p>\n<div class=\"curves\">";
    for (gain, cost) in Gain::ALL.into_iter().flat_map(|gain| Cost::ALL.map(|cost| (gain, cost))) {
        out += &plot(&curves, cost, gain)?;
    }
    Ok(out + "</div>\n")
}

/// The slider of one view, and a row for the photograph and for each scene.
fn view(i: usize, photo: &str, entries: &[Entry]) -> String {
    let name = entries.first().map_or_else(String::new, |entry| escape(&entry.views[i].name));
    let image = |class: &str, what: &str, source: &str| {
        // Enlarged, small pictures show their pixels.
        let small = if source.starts_with("data:image/png") { " small" } else { "" };
        format!("<img class=\"{class}{small}\" alt=\"{what} of {name}\" src=\"{source}\">")
    };
    let mut out = format!(
        "<section class=\"view\"><h3>{name}</h3><div class=\"slider\"><div class=\"pair\"><img class=\"right\" alt=\"\"><img \
         class=\"left\" alt=\"\"></div><input type=\"range\" min=\"0\" max=\"100\" value=\"50\" aria-label=\"border\"></div>\n<table>\
         <thead><tr><th></th><th>PSNR [dB]</th><th>SSIM</th><th>picture</th><th>error</th><th>diffuse</th><th>specular</th></tr>\
         </thead><tbody>\n<tr><td>photo</td><td></td><td></td><td>{}</td><td></td><td></td><td></td></tr>\n",
        image("shot", "photo", photo)
    );
    for entry in entries {
        let EntryView { quality, pictures, .. } = &entry.views[i];
        let scene = escape(&entry.name);
        let _ = write!(out, "<tr><td>{scene}</td>{}", cells(quality));
        for (what, class) in [("render", "shot"), ("error", "part"), ("diffuse", "part"), ("specular", "part")] {
            let found = pictures.iter().find(|(name, _)| *name == what);
            let shown = found.map_or_else(String::new, |(_, source)| image(class, &format!("{scene}: {what}"), source));
            let _ = write!(out, "<td>{shown}</td>");
        }
        out += "</tr>\n";
    }
    out + "</tbody></table></section>\n"
}

#[cfg(test)]
mod tests {
    use super::super::page::data_of;
    use super::*;

    fn entry(name: &str, psnr: f64, parts: bool) -> Entry {
        let quality = Quality { psnr, ssim: 0.5 };
        let picture = |color| data_of(&image::RgbImage::from_pixel(8, 6, image::Rgb(color))).unwrap();
        let mut pictures = vec![("render", picture([9, 9, 9])), ("error", picture([200, 0, 0]))];
        if parts {
            pictures.extend([("diffuse", picture([0, 200, 0])), ("specular", picture([0, 0, 200]))]);
        }
        let view = |name: &str| EntryView { name: name.into(), quality, pictures: pictures.clone() };
        let views = vec![view("one<i>"), view("two")];
        Entry { name: name.into(), gaussians: 7, supplementary: 2, bytes: 1234, mean: quality, views }
    }

    #[test]
    fn a_page_has_every_scene_view_and_curve_once_and_nothing_of_the_net() {
        let photos: Vec<String> = [[1, 2, 3], [4, 5, 6]]
            .map(|color| data_of(&image::RgbImage::from_pixel(300, 20, image::Rgb(color))).unwrap())
            .to_vec();
        let record = |name: &str, seed, seconds: f64, holdout: &str| Record {
            name: name.into(),
            seconds,
            bytes: 100,
            gaussians: 5,
            psnr: 20.0 + seconds,
            ssim: 0.7,
            seed,
            holdout: holdout.into(),
        };
        let history = [
            record("<u>", 0, 1.0, "every"),
            record("<u>", 1, 3.0, "every"),
            record("plain", 0, 2.0, "every"),
            record("plain", 0, 2.0, "sector"),
        ];
        let html = page(
            "a & b",
            &photos,
            &[entry("base", 20.125, false), entry("more<b>", f64::INFINITY, true)],
            &history,
            &[],
        )
        .unwrap();
        let count = |part: &str| html.matches(part).count();
        assert!(html.contains("<title>a &amp; b</title>") && !html.contains("://"));
        assert_eq!([count("<b>"), count("<i>"), count("<u>")], [0; 3]);
        assert_eq!((count("<section"), count("type=\"range\""), count("<select>")), (2, 2, 2));
        assert_eq!(count("<option value=\"2\">more&lt;b&gt;</option>"), 2);
        // Photograph and two scenes of two views; errors of both scenes, two parts of one.
        assert_eq!((count("class=\"shot"), count("class=\"part")), (6, 8));
        // Photographs are large, all others small.
        assert_eq!((count("data:image/jpeg"), count("data:image/png")), (2, 12));
        assert_eq!((count("<svg"), count("hold-out every"), count("hold-out sector")), (12, 1, 1));
        assert!(html.contains("<td>22.00 (21.00 to 23.00)</td>") && html.contains("<td>7</td><td>2</td><td>1234</td>"));
        assert!(html.contains("<td>mean</td><td>20.12</td><td>0.5000</td><td>Infinity</td><td>0.5000</td>"));
        let without = page("x", &photos, &[entry("base", 20.0, false)], &[], &[]).unwrap();
        assert!(!without.contains("<svg") && !without.contains("Work and precision"));
    }
}
