//! Replays `fuzz/corpus`: files that are odd, damaged, or once broke a reader (see tools/fuzz). For any bytes
//! a reader must not panic. Its error must be one line that names the file. Time is limited to a moment, and
//! memory in proportion to the file's size.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    fs,
    panic::catch_unwind,
    path::Path,
    time::{Duration, Instant},
};

use glint::data::{check_file, file_kinds};
use rand::{RngExt, SeedableRng, seq::IndexedMutRandom};
use rand_chacha::ChaCha8Rng;

/// Counts the bytes held by a thread, so that parallel tests do not interfere.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    // Missing while a thread ends, when no measurement runs.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + bytes);
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held.get())));
    });
}

// SAFETY: every call is passed on to the system's allocator as it came; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // While a block moves, both copies are held.
        count(size as isize);
        let moved = unsafe { System.realloc(pointer, layout, size) };
        count(-(layout.size() as isize));
        moved
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Maximum bytes of the results per byte of a file, counting old and new arrays during growth. A camera line
/// of 10 bytes becomes an entry of 160 in a list and another in a map (40 measured); unused JSON values
/// (`0,`) are kept as 32 bytes each (25 measured); the narrowest row of a point cloud, 3 bytes, becomes 15.
const BYTES_PER_BYTE: usize = 64;
/// A message, a header's names, a decoder's tables and windows.
const FIXED_BYTES: usize = 64 << 10;
/// A pixel of 16-bit RGBA is decoded to 8 bytes, becomes 16 as floats, 12 over the background and 3 in the
/// end. The files here have few pixels, or claim more than they hold.
const IMAGE_BYTES: usize = 1 << 20;
/// A damaged image may claim many more pixels. The decoder's own limit is 2 GiB.
const DAMAGED_IMAGE_BYTES: usize = 2 << 30;
/// A compressed scene may inflate to 256 times its file plus a megabyte (SOG's images one by one: four times
/// the part being read). Then it becomes numbers: 9 bytes of a position in SPZ become 12, a byte of opacity
/// 4, one of a harmonic 4.
const INFLATED_BYTES_PER_BYTE: usize = 8 * 256;
const INFLATED_FIXED: usize = 8 << 20;
/// The slowest file takes 0.3 s on an idle machine; a slow and busy one has taken four times that. Quadratic
/// work on a megabyte would take minutes.
const MOMENT: Duration = Duration::from_secs(5);

/// Damaged copies of each file.
const COPIES: usize = 200;

/// Returns the error's text, if there was an error.
#[track_caller]
fn replay(kind: &str, name: &str, bytes: &[u8], image_bytes: usize) -> Option<String> {
    let path = Path::new(name);
    let before = HELD.get();
    PEAK.set(before);
    let begin = Instant::now();
    let result = catch_unwind(|| check_file(kind, bytes, path).map_err(|error| error.to_string()));
    let (took, peak) = (begin.elapsed(), (PEAK.get() - before) as usize);
    let message = result.unwrap_or_else(|_| panic!("{name}: the reader panicked")).err();
    let (each, more) = match kind {
        "image" => (BYTES_PER_BYTE, image_bytes),
        "spz" | "sog" | "glb" | "usdz" => (INFLATED_BYTES_PER_BYTE, INFLATED_FIXED),
        _ => (BYTES_PER_BYTE, 0),
    };
    let allowed = each * bytes.len() + FIXED_BYTES + more;
    eprintln!("{name}: {} bytes, {peak} held, {took:.1?}: {}", bytes.len(), message.as_deref().unwrap_or("sound"));
    assert!(peak <= allowed, "{name}: {peak} bytes of memory for {} of file; {allowed} are allowed", bytes.len());
    assert!(took < MOMENT, "{name}: {took:?}");
    if let Some(message) = &message {
        assert!(message.contains(name), "{name} is not in: {message}");
        assert!(!message.contains(char::is_control), "control characters: {message:?}");
        assert!(message.chars().count() < name.len() + 900, "{name}: a message of {} bytes", message.len());
    }
    message
}

/// A copy with up to five bytes changed; half of all copies end early.
fn damaged(bytes: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut copy = bytes.to_vec();
    for _ in 0..random.random_range(0..6) {
        if let Some(byte) = copy.choose_mut(random) {
            *byte = random.random();
        }
    }
    copy.truncate(random.random_range(0..=2 * bytes.len()));
    copy
}

/// Every file as it is, and damaged copies of it.
#[test]
fn no_file_of_the_corpus_breaks_its_reader() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    let mut folders: Vec<String> =
        fs::read_dir(&corpus).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    let mut kinds: Vec<&str> = file_kinds().collect();
    folders.sort();
    kinds.sort();
    assert_eq!(folders, kinds, "every kind of file has a folder");
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let targets = fs::read_to_string(corpus.with_file_name("Cargo.toml")).unwrap();
    for folder in kinds {
        assert!(targets.contains(&format!("name = \"{folder}\"")), "{folder} has no target in fuzz/Cargo.toml");
        let (mut sound, mut files) = (0, 0);
        for entry in fs::read_dir(corpus.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{folder}/{}", path.file_name().unwrap().display());
            let bytes = fs::read(path).unwrap();
            sound += replay(folder, &name, &bytes, IMAGE_BYTES).is_none() as usize;
            files += 1;
            for copy in 0..COPIES {
                let name = format!("{name}, copy {copy}");
                replay(folder, &name, &damaged(&bytes, &mut random), DAMAGED_IMAGE_BYTES);
            }
        }
        assert!(sound > 0 && sound < files, "{folder}: {sound} of {files} files are sound; both sorts are wanted");
    }
}

/// Inputs that are only harmful if long: a megabyte of repetitions.
#[test]
fn long_files_take_no_longer_than_their_length() {
    let lines = |begin: &str, line: &dyn Fn(usize) -> String, end: &str| {
        let mut text = begin.to_owned();
        for i in 0.. {
            let line = line(i);
            if text.len() + line.len() + end.len() > 1_000_000 {
                break;
            }
            text += &line;
        }
        text + end
    };
    let ply = "ply\nformat ascii 1.0\n";
    let vertex = format!("{ply}element vertex 1\n");
    // Every node names the mesh, whose primitives are a third of the file.
    let (primitives, nodes) = (vec!["{\"attributes\":{}}"; 20_000].join(","), vec!["{\"mesh\":0}"; 30_000].join(","));
    let roots = (0..30_000).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    let meshes = format!(
        "{{\"scenes\":[{{\"nodes\":[{roots}]}}],\"nodes\":[{nodes}],\"meshes\":[{{\"primitives\":[{primitives}]}}]}}"
    );
    let cases = [
        ("properties.ply", "ply", lines(&vertex, &|i| format!("property int p{i}\n"), "end_header\n")),
        ("elements.ply", "ply", lines(ply, &|i| format!("element e{i} 0\n"), "end_header\n")),
        ("words.ply", "ply", lines(ply, &|_| "a ".into(), "\nend_header\n")),
        ("one_line.ply", "ply_points", lines(ply, &|_| "elephant".into(), "\nend_header\n")),
        ("rest.ply", "ply", lines(&vertex, &|i| format!("property int f_rest_{i}\n"), "end_header\n")),
        ("long_word.txt", "colmap_cameras_txt", lines("1 PINHOLE ", &|_| "x".into(), "\n")),
        ("cameras.txt", "colmap_cameras_txt", lines("", &|i| format!("{i} PINHOLE 1 1 1 1 1 1\n"), "")),
        ("images.txt", "colmap_images_txt", lines("", &|_| "1 1 0 0 0 0 0 0 1 a\n\n".into(), "")),
        ("points.txt", "colmap_points_txt", lines("", &|_| "1 1 0 0 0 0 0\n".into(), "")),
        (
            "frames.json",
            "transforms_json",
            lines("{\"frames\":[", &|_| "{\"file_path\":\"\",\"transform_matrix\":[]},".into(), "0]}"),
        ),
        ("rows.json", "transforms_json", lines("{\"frames\":[{\"transform_matrix\":[", &|_| "[],".into(), "[]]}]}")),
        (
            "keys.json",
            "camera_path",
            lines(
                "{\"width\":1,\"height\":1,\"keys\":[",
                &|_| "{\"eye\":[0,0,0],\"rotation\":[1,0,0,0],\"focal\":[1,1],\"center\":[0,0]},".into(),
                "0]}",
            ),
        ),
        ("strangers.json", "transforms_json", lines("{\"frames\":[],\"x\":[", &|_| "0,".into(), "0]}")),
        ("nests.json", "transforms_json", lines("{\"frames\":", &|_| "[".into(), "")),
        ("nests.gltf", "glb", lines("{\"nodes\":", &|_| "[".into(), "")),
        ("accessors.gltf", "glb", lines("{\"scene\":0,\"scenes\":[{}],\"accessors\":[", &|_| "0,".into(), "0]}")),
        ("meshes.gltf", "glb", meshes),
        ("meta.json", "sog", lines("{\"version\":2,\"x\":[", &|_| "0,".into(), "0]}")),
        ("zeros.splat", "splat", lines("", &|_| "\0".repeat(32), "")),
        (
            "chunks.ply",
            "ply",
            lines(ply, &|i| format!("element chunk{i} 0\nproperty uint packed_position\n"), "end_header\n"),
        ),
    ];
    for (name, kind, text) in cases {
        replay(kind, name, text.as_bytes(), IMAGE_BYTES);
    }
    let tensors: Vec<String> =
        (0..8_000).map(|i| format!("\"t{i}\":{{\"dtype\":\"F32\",\"shape\":[0],\"data_offsets\":[0,0]}}")).collect();
    let header = format!("{{{}}}", tensors.join(","));
    let bytes = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes()].concat();
    assert_eq!(replay("safetensors", "tensors", &bytes, IMAGE_BYTES), None);
}
