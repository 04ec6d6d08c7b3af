//! Tests RAD.

use std::io::{Read, Write};

use flate2::{Compression, read::DeflateDecoder, write::DeflateEncoder};
use serde_json::{Value, json};

use super::*;

/// A header, and the bytes behind it from a multiple of 8 on.
fn split<'a>(bytes: &'a [u8], magic: &[u8]) -> (Value, &'a [u8]) {
    assert_eq!(&bytes[..4], magic);
    let length = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[8..8 + length]).unwrap(), &bytes[(8 + length).next_multiple_of(8)..])
}

fn headed(magic: &[u8], header: &Value) -> Vec<u8> {
    let text = header.to_string();
    let mut out = [magic, &(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A property of the first chunk.
fn property(bytes: &[u8], name: &str) -> Vec<u8> {
    let (_, chunks) = split(bytes, b"RAD0");
    let (chunk, payload) = split(chunks, b"RADC");
    let found = chunk["properties"].as_array().unwrap().iter().find(|of| of["property"] == name).unwrap();
    let [offset, length] = ["offset", "bytes"].map(|of| found[of].as_u64().unwrap() as usize);
    let mut out = Vec::new();
    DeflateDecoder::new(&payload[8 + offset..][..length]).read_to_end(&mut out).unwrap();
    out
}

/// A file of two Gaussians without a tree, with these properties: name, encoding, bytes, range.
fn handmade(properties: &[(&str, &str, Vec<u8>, [f32; 2])]) -> Vec<u8> {
    let (mut payload, mut listed) = (Vec::new(), Vec::new());
    for (name, encoding, bytes, [min, max]) in properties {
        let mut packed = DeflateEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(bytes).unwrap();
        let packed = packed.finish().unwrap();
        listed.push(json!({"offset": payload.len(), "bytes": packed.len(), "property": name, "encoding": encoding,
            "compression": "gz", "min": min, "max": max}));
        payload.extend(packed);
        payload.resize(payload.len().next_multiple_of(8), 0);
    }
    let header =
        json!({"version": 1, "base": 0, "count": 2, "payloadBytes": payload.len(), "maxSh": 1, "properties": listed});
    let chunk = [&headed(b"RADC", &header)[..], &(payload.len() as u64).to_le_bytes(), &payload].concat();
    let header = json!({"version": 1, "type": "gsplat", "count": 2, "maxSh": 1, "chunkSize": 65536,
        "allChunkBytes": chunk.len(), "chunks": [{"offset": 0, "bytes": chunk.len()}]});
    [headed(b"RAD0", &header), chunk].concat()
}

fn halves(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|&v| half::f16::from_f32(v).to_le_bytes()).collect()
}

type Properties = Vec<(&'static str, &'static str, Vec<u8>, [f32; 2])>;

fn properties() -> Properties {
    vec![
        ("center", "f32", [1f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect(), [0.0; 2]),
        ("alpha", "r8", vec![51, 255], [0.0, 2.0]),
        // Red of both, then green, then blue.
        ("rgb", "r8_delta", vec![0, 255, 51, 0, 255, 1], [0.0, 1.0]),
        ("scales", "ln_0r8", vec![1, 255, 0, 128, 1, 1], [-12.0, 9.0]),
        // Half a turn around x; none.
        ("orientation", "oct88r8", vec![255, 128, 255, 0, 0, 0], [0.0; 2]),
        ("sh1", "s8", (0..18).map(|v| v * 7).collect(), [-2.0, 2.0]),
    ]
}

/// The encodings of the format's source, also those that glint does not write.
#[test]
fn encodings_are_read_as_described() {
    let base = read("a.rad", &handmade(&properties())).unwrap().scene.base;
    assert_eq!((base.len(), base.sh_degree), (2, 1));
    assert_eq!(base.means, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert!((opacity(&base, 0)[0] - 0.4).abs() < ROUNDING && opacity(&base, 1)[0] > 0.999);
    let color = |i: usize| harmonics(0)(&base, i).into_iter().map(|v| 0.5 + 0.282_094_79 * v).collect::<Vec<_>>();
    let near = |a: Vec<f64>, b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(near(color(0), &[0.0, 0.2, 1.0]) && near(color(1), &[1.0, 0.2, 0.0]), "{:?} {:?}", color(0), color(1));
    assert!(
        near(log_scales(&base, 0)[..1].to_vec(), &[-12.0])
            && near(log_scales(&base, 1), &[9.0, -12.0 + 127.0 / 254.0 * 21.0])
    );
    assert!(base.log_scales[0][1] < -87.0);
    assert!(
        turned(&base, &Gaussians { quats: vec![[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]], ..base.clone() }) < 0.02
    );
    // Coefficient by coefficient, red, green, blue; both Gaussians of each.
    let wanted = |v: usize| 7.0 * v as f64 / 127.0 * 2.0;
    assert!(near(harmonics(1)(&base, 1), &(0..9).map(|v| wanted(2 * v + 1)).collect::<Vec<_>>()));

    let with = |name: &str, encoding: &'static str, bytes: Vec<u8>| {
        let mut properties = properties();
        let of = properties.iter_mut().find(|of| of.0 == name).unwrap();
        (of.1, of.2) = (encoding, bytes);
        read("a.rad", &handmade(&properties)).map(|file| file.scene.base)
    };
    let bytes = |of: &dyn Fn(f32) -> Vec<u8>| -> Vec<u8> {
        let rows: Vec<Vec<u8>> = [1f32, 4.0, 2.0, 5.0, 3.0, 6.0].iter().map(|&v| of(v)).collect();
        (0..rows[0].len()).flat_map(|byte| rows.iter().map(move |row| row[byte])).collect()
    };
    for (encoding, bytes) in [
        ("f32_lebytes", bytes(&|v| v.to_le_bytes().to_vec())),
        ("f16_lebytes", bytes(&|v| halves(&[v]))),
        ("f16", halves(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0])),
    ] {
        assert_eq!(with("center", encoding, bytes).unwrap().means, base.means, "{encoding}");
    }
    let scales = with("scales", "ln_f16", halves(&[-1.0, 1.0, -2.0, 2.0, -3.0, 3.0])).unwrap();
    assert!(near(log_scales(&scales, 1), &[1.0, 2.0, 3.0]));
    let turns = with("orientation", "f16", halves(&[0.0, 0.5, 0.5, 0.5, 0.0, 0.5])).unwrap();
    assert!(
        turned(&turns, &Gaussians { quats: vec![[0.75f32.sqrt(), 0.0, 0.5, 0.0], [0.5; 4]], ..turns.clone() }) < 1e-3
    );
    let deltas = with("sh1", "s8_delta", [7, 0xfe].repeat(9)).unwrap();
    assert!(near(harmonics(1)(&deltas, 1), &[5.0 / 127.0 * 2.0; 9]));
    for (encoding, bytes, word) in [("r3", vec![], "r3"), ("f16", vec![0; 11], "11 bytes, expected 12")] {
        let refused = with("center", encoding, bytes).unwrap_err();
        assert!(refused.contains("`center` of chunk 0") && refused.contains(word), "{refused}");
    }
}

/// The children of each Gaussian follow one another, all but the root have one parent, and leaves are the scene.
#[test]
fn a_tree_holds_the_scene_in_its_leaves() {
    let scene = sample(3, 3000, 3);
    let (back, bytes) = round_trip(&scene, "rad");
    assert_eq!(bytes, round_trip(&scene, "rad").1);
    let words = |name: &str, width: usize| -> Vec<usize> {
        property(&bytes, name)
            .chunks(width)
            .map(|word| word.iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte)))
            .collect()
    };
    let (counts, starts) = (words("child_count", 2), words("child_start", 4));
    let mut next = 1;
    for (&count, &start) in counts.iter().zip(&starts) {
        assert!(count != 1 && if count == 0 { start == 0 } else { start == next });
        next += count;
    }
    assert_eq!((next, counts.iter().filter(|&&count| count == 0).count()), (counts.len(), 3000));
    assert_eq!(split(&bytes, b"RAD0").0["count"], counts.len());

    // Leaves have another order; means are exact.
    let key = |g: &Gaussians| {
        let mut order: Vec<usize> = (0..g.len()).collect();
        order.sort_by_key(|&i| g.means[i].map(f32::to_bits));
        g.reordered(&order)
    };
    let (a, b) = (key(&scene.base), key(&back.base));
    assert_eq!(a.means, b.means);
    // float16 has 11 bits: half a unit of 1 for opacities, of 8 for logarithms.
    assert!(largest(&a, &b, opacity) <= 0.5 / 1024.0 && largest(&a, &b, log_scales) <= 8.0 * 0.5 / 1024.0);
    // Half a step of π/255 of the angle. Half a step of the axis's two bytes is 1/255 on two axes of the octahedron and up to 2/255 on
    // the third, √6/255 in all; the octahedron is 1/√3 from the center at the nearest, and half a turn doubles the axis's angle.
    assert!(turned(&a, &b) < 0.5 * std::f64::consts::PI / 255.0 + 2.0 * 18f64.sqrt() / 255.0, "{}", turned(&a, &b));
    // One coefficient in a thousand may be clamped; sizes of a sample have no long tails.
    let most = a.sh.iter().flatten().fold(0f32, |most, v| most.max(v.abs()));
    let off: Vec<f32> = a.sh.iter().flatten().zip(b.sh.iter().flatten()).map(|(a, b)| (a - b).abs()).collect();
    let beyond = off.iter().filter(|&&off| off > 0.51 * most / 127.0).count();
    assert!(beyond <= off.len() / 900, "{beyond} of {}", off.len());
}

#[test]
fn damaged_files_are_refused() {
    let bytes = round_trip(&sample(5, 12, 1), "rad").1;
    // The last bytes pad the last property.
    let last = split(split(&bytes, b"RAD0").1, b"RADC").0["properties"].as_array().unwrap().last().unwrap().clone();
    let end = (last["offset"].as_u64().unwrap() + last["bytes"].as_u64().unwrap()) as usize;
    let payload = bytes.len() - end.next_multiple_of(8);
    damage("a.rad", &bytes, |length| length >= payload + end && length == bytes.len());
    refused("a.rad", &handmade(&[]), &["chunk 0", "lacks `center`"]);
    let (mut header, chunks) = split(&bytes, b"RAD0");
    header["chunks"][0]["filename"] = "a-0.radc".into();
    refused("a.rad", &[&headed(b"RAD0", &header), chunks].concat(), &["other files", "a-0.radc"]);
    header["version"] = 2.into();
    refused("a.rad", &[&headed(b"RAD0", &header), chunks].concat(), &["version 2"]);
}

/// A short file may name one chunk many times.
#[test]
fn chunks_in_the_same_bytes_promise_no_more_than_the_file_may() {
    let bytes = round_trip(&sample(6, 3000, 1), "rad").1;
    let (mut header, chunks) = split(&bytes, b"RAD0");
    header["chunks"] = vec![header["chunks"][0].clone(); 1000].into();
    refused("a.rad", &[&headed(b"RAD0", &header), chunks].concat(), &["promises", "Gaussians up to chunk"]);
}
