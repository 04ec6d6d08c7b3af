//! An evaluation as pictures and one HTML page that needs nothing beside it.

use std::fmt::Write;

use base64::{Engine, engine::general_purpose::STANDARD};
use image::{
    ExtendedColorType, ImageEncoder, RgbImage,
    codecs::{jpeg::JpegEncoder, png::PngEncoder},
    imageops::thumbnail,
};

use super::evaluate::{Compared, Evaluation, ViewQuality};
use super::metrics::Quality;
use super::sidebyside::{error_map, to_bytes};
use crate::Error;
use crate::data::Image;

/// Error at the bright end of the error pictures' colours.
pub const FULL_ERROR: f32 = 0.25;
/// The longer side of a picture in the page, pixels; those of full size are files beside it.
const SHOWN: u32 = 400;
/// JPEG's, of 100: the pictures are to be looked at, not measured.
const SHOWN_QUALITY: u8 = 85;
/// Pictures up to this many pixels a side are shown as they are.
const SMALL: u32 = 256;
/// What pixels that do not count are drawn toward.
const LEFT_OUT: u8 = 128;

/// The pictures of a view: what each shows, and its pixels.
pub type Pictures = Vec<(&'static str, RgbImage)>;

/// Photograph, render, the base's render where that is another, and the error. Where a mask leaves pixels out, photograph and
/// error are grey.
pub fn pictures(view: &Compared<'_>, augmented: bool) -> Pictures {
    let Image { width, height, rgb, mask } = view.truth;
    let left_out = |i: usize| mask.as_ref().is_some_and(|mask| !mask[i]);
    let grey = |mut bytes: Vec<u8>, share: u16| {
        for (_, pixel) in bytes.chunks_exact_mut(3).enumerate().filter(|(i, _)| left_out(*i)) {
            pixel.iter_mut().for_each(|v| *v = ((u16::from(*v) * (4 - share) + u16::from(LEFT_OUT) * share) / 4) as u8);
        }
        bytes
    };
    let picture = |bytes| RgbImage::from_vec(*width, *height, bytes).unwrap_or_default();
    let mut all = vec![("photo", picture(grey(rgb.clone(), 3))), ("render", picture(to_bytes(&view.whole.color)))];
    if augmented {
        all.push(("base", picture(to_bytes(&view.base.color))));
    }
    all.push(("error", picture(grey(error_map(&view.whole.color, rgb, FULL_ERROR), 4))));
    all
}

/// The page, view by view.
pub struct Page {
    rows: String,
    augmented: bool,
}

impl Page {
    /// With columns of the base if the scene is `augmented`.
    pub fn new(augmented: bool) -> Self {
        Page { rows: String::new(), augmented }
    }

    /// Adds a view whose pictures are the files `stem.photo.png` and so on.
    pub fn add(&mut self, quality: &ViewQuality, stem: &str, pictures: &Pictures) -> Result<(), Error> {
        let name = escape(&quality.name);
        let _ = write!(self.rows, "<tr><td>{name}</td>");
        if self.augmented {
            self.rows += &cells(&quality.base);
        }
        self.rows += &cells(&quality.augmented);
        for (what, picture) in pictures {
            let (source, file) = (shown(picture)?, escape(&format!("{stem}.{what}.png")));
            let _ =
                write!(self.rows, "<td><a href=\"{file}\"><img alt=\"{what} of {name}\" src=\"{source}\"></a></td>");
        }
        self.rows += "</tr>\n";
        Ok(())
    }

    /// The whole page. `title` says what was compared with what.
    pub fn finish(self, title: &str, found: &Evaluation) -> String {
        let title = escape(title);
        let metrics = |part: &str| format!("<th>{part}PSNR [dB]</th><th>{part}SSIM</th>");
        let (mut heads, mut means) = (String::from("<th>view</th>"), format!("<td>mean of {}</td>", found.views.len()));
        if self.augmented {
            heads += &metrics("base ");
            means += &cells(&found.base);
        }
        heads += &metrics("");
        means += &cells(&found.augmented);
        let columns: &[&str] =
            if self.augmented { &["photo", "render", "base", "error"] } else { &["photo", "render", "error"] };
        for column in columns {
            let _ = write!(heads, "<th class=\"picture\">{column}</th>");
            means += "<td></td>";
        }
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\n<style>{STYLE}</style>\n\
             </head><body><h1>{title}</h1>\n<p>{EXPLAINED}</p>\n<table><thead><tr>{heads}</tr></thead>\n<tbody>{}</tbody>\n\
             <tfoot><tr>{means}</tr></tfoot></table>\n<script>{SCRIPT}</script></body></html>\n",
            self.rows
        )
    }
}

const EXPLAINED: &str = "PSNR and SSIM are of unquantised renders, clamped to 0 to 1, against the photographs; grey pixels are left \
    out by a mask. Errors are means over the channels, from 0 (dark) to 0.25 and more (pale). A click on a column's head sorts by \
    it, one on a picture shows it in full size.";

pub(super) const STYLE: &str = "body{font:15px/1.4 system-ui,sans-serif;margin:2rem;color:#222;background:#fff}h1{font-size:1.3rem}\
    p{max-width:60rem;color:#555}table{border-collapse:collapse}th,td{padding:.3rem .6rem;text-align:right;vertical-align:top;\
    border-bottom:1px solid #e3e3e3;font-variant-numeric:tabular-nums}th{position:sticky;top:0;background:#fff;cursor:pointer;\
    white-space:nowrap}th.picture{text-align:left;cursor:default}td:first-child,th:first-child{text-align:left}\
    tfoot td{font-weight:600;border-top:2px solid #888}img{display:block;max-width:400px;height:auto}";

/// Sorts rows by a column of numbers or names; the second click turns the order round.
const SCRIPT: &str = "document.querySelectorAll('th:not(.picture)').forEach((head,i)=>head.onclick=()=>{\
    const body=document.querySelector('tbody'),down=head.dataset.down=head.dataset.down==='1'?'0':'1';\
    const key=row=>{const text=row.cells[i].textContent;return i?parseFloat(text):text};\
    [...body.rows].sort((a,b)=>{const x=key(a),y=key(b);return (x<y?-1:x>y?1:0)*(down==='1'?1:-1)})\
    .forEach(row=>body.append(row))});";

pub(super) fn cells(quality: &Quality) -> String {
    format!("<td>{}</td><td>{:.4}</td>", decibels(quality.psnr), quality.ssim)
}

/// An infinite one sorts as a number too.
pub(super) fn decibels(psnr: f64) -> String {
    if psnr.is_finite() { format!("{psnr:.2}") } else { "Infinity".into() }
}

/// A table that scrolls where the window is narrower.
pub(super) fn scrolling(class: &str, content: &str) -> String {
    format!("<div class=\"scroll\"><table class=\"{class}\">{content}</table></div>\n")
}

/// A picture as a `data:` address for a page: PNG up to 256 pixels a side; larger ones are reduced to 400, and JPEG.
///
/// # Errors
/// Of the encoders.
pub fn data_of(picture: &RgbImage) -> Result<String, Error> {
    let (width, height) = picture.dimensions();
    if width.max(height) > SMALL {
        return shown(picture);
    }
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(picture.as_raw(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| Error::Usage(format!("a picture of {width} × {height} cannot be shown: {error}")))?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

/// A picture as a part of the page.
fn shown(picture: &RgbImage) -> Result<String, Error> {
    let (width, height) = picture.dimensions();
    let shrink = f64::from(SHOWN) / f64::from(width.max(height).max(1));
    let side = |side: u32| ((f64::from(side) * shrink.min(1.0)).round() as u32).max(1);
    let small = if shrink < 1.0 { thumbnail(picture, side(width), side(height)) } else { picture.clone() };
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, SHOWN_QUALITY)
        .write_image(small.as_raw(), small.width(), small.height(), ExtendedColorType::Rgb8)
        .map_err(|error| Error::Usage(format!("a picture of {width} × {height} cannot be shown: {error}")))?;
    Ok(format!("data:image/jpeg;base64,{}", STANDARD.encode(jpeg)))
}

pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Photo, PixelSource, Split};
    use crate::pipelines::render::Rendered;
    use crate::scene::Camera;
    use glam::{DMat3, DVec3};
    use std::sync::Arc;

    #[test]
    fn pictures_show_what_they_are_called_and_are_grey_where_nothing_counts() {
        let truth = Image { width: 2, height: 1, rgb: vec![0, 100, 200, 10, 20, 30], mask: Some(vec![true, false]) };
        let rendered =
            |color: Vec<f32>| Rendered { width: 2, height: 1, color, transmittance: vec![0.0; 2], depth: Vec::new() };
        let (base, whole) = (rendered(vec![1.0; 6]), rendered(vec![0.5, 2.0, -1.0, 0.5, 0.5, 0.5]));
        let camera = Camera {
            width: 2,
            height: 1,
            fx: 1.0,
            fy: 1.0,
            cx: 1.0,
            cy: 0.5,
            rotation: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        };
        let pixels = PixelSource::Memory(Arc::new(truth.clone()));
        let photo = Photo { name: "a".into(), camera, split: Split::Test, pixels };
        let quality = Quality { psnr: 20.0, ssim: 0.5 };
        let quality = ViewQuality { name: "a".into(), base: quality, augmented: quality };
        let view = Compared { photo: &photo, truth: &truth, base: &base, whole: &whole, quality: &quality };
        let all = pictures(&view, true);
        let bytes = |what: &str| all.iter().find(|(name, _)| *name == what).unwrap().1.as_raw().clone();
        // A quarter of what it was and three of grey.
        assert_eq!(bytes("photo"), [0, 100, 200, 98, 101, 103]);
        assert_eq!(bytes("render"), [128, 255, 0, 128, 128, 128]);
        assert_eq!(bytes("base"), [255; 6]);
        // Errors of 0.5, 0.61 and 0.78 are more than a quarter in the mean.
        assert_eq!(bytes("error"), [&super::super::sidebyside::color_of(1.0)[..], &[128; 3]].concat());
        assert_eq!(pictures(&view, false).len(), 3);
    }

    #[test]
    fn the_page_has_every_view_its_pictures_and_no_markup_of_strangers() {
        let quality = |psnr| Quality { psnr, ssim: 0.5 };
        let view = |name: &str, psnr| ViewQuality { name: name.into(), base: quality(10.0), augmented: quality(psnr) };
        let pictures: Pictures = vec![("photo", RgbImage::from_pixel(900, 300, image::Rgb([200, 30, 10])))];
        let mut page = Page::new(true);
        page.add(&view("<b>&\"'", 25.125), "stem", &pictures).unwrap();
        page.add(&view("second", f64::INFINITY), "second", &pictures).unwrap();
        let views = vec![view("<b>&\"'", 25.125), view("second", f64::INFINITY)];
        let found = Evaluation { base: quality(10.0), augmented: quality(30.5), views };
        let html = page.finish("a <scene>", &found);
        assert!(html.contains("<title>a &lt;scene&gt;</title>") && !html.contains("<scene>") && !html.contains("<b>"));
        assert!(html.contains("<td>&lt;b&gt;&amp;&quot;&#39;</td><td>10.00</td><td>0.5000</td><td>25.12</td>"));
        assert!(
            html.contains("<td>Infinity</td>")
                && html.contains("<td>mean of 2</td><td>10.00</td><td>0.5000</td><td>30.50</td>")
        );
        assert!(html.contains("href=\"stem.photo.png\"") && html.contains("base PSNR"));
        // Nothing is fetched from anywhere.
        assert!(!html.contains("http") && !html.contains("src=\"s"));
        // Reduced to 400 pixels, of the colour it has.
        let at = html.find("data:image/jpeg;base64,").unwrap() + 23;
        let data = &html[at..at + html[at..].find('"').unwrap()];
        let small = image::load_from_memory(&STANDARD.decode(data).unwrap()).unwrap().into_rgb8();
        assert_eq!(small.dimensions(), (400, 133));
        // JPEG of one colour: within a step or two.
        assert!(small.get_pixel(50, 50).0.iter().zip([200u8, 30, 10]).all(|(a, b)| a.abs_diff(b) < 4));
        assert!(!Page::new(false).finish("plain", &found).contains("base PSNR"));
    }
}
