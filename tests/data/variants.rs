//! One dataset written in all known forms, each of which must load to the same cameras and pixels.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use glint::data::{Alpha, DatasetOptions, Holdout, PointCloud};
use glint::scene::Camera;
use image::{DynamicImage, ImageBuffer, Rgb, RgbImage};
use serde_json::{Value, json};
use tempfile::TempDir;

/// The dataset itself. Photos are sorted by name.
pub struct Plain {
    pub names: Vec<String>,
    pub cameras: Vec<Camera>,
    pub photos: Vec<RgbImage>,
    pub points: PointCloud,
}

/// Path to open for a variant, with options.
pub type Written = (PathBuf, DatasetOptions);

impl Plain {
    /// `n` photos of noise with `width` × `height` pixels, at random cameras; some names include `folder`.
    pub fn new(n: usize, [width, height]: [u32; 2], focal: [f64; 2], folder: &str, seed: u64) -> Plain {
        let mut state = seed.wrapping_mul(2).wrapping_add(1);
        let mut next = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut signed = {
            let mut next = next;
            move || next() as f64 / (1u64 << 30) as f64 - 1.0
        };
        let name =
            |i: usize| if i.is_multiple_of(3) { format!("{folder}/p{i:02}.png") } else { format!("p{i:02}.png") };
        let mut names: Vec<String> = (0..n).map(name).collect();
        names.sort();
        let cameras = (0..n).map(|_| {
            let turn = DQuat::from_xyzw(signed(), signed(), signed(), 1.5).normalize();
            let (rotation, translation) = (DMat3::from_quat(turn), DVec3::new(signed(), signed(), 3.0 + signed()));
            let [fx, fy] = focal;
            // Not in the middle, and not a round number.
            let (cx, cy) = (0.5 * f64::from(width) + 0.3 * signed(), 0.5 * f64::from(height) - 0.7 * signed());
            Camera { width, height, fx, fy, cx, cy, rotation, translation }
        });
        let cameras: Vec<Camera> = cameras.collect();
        // A common principal point, as for a single camera.
        let first = cameras[0];
        let cameras = cameras.into_iter().map(|c| Camera { cx: first.cx, cy: first.cy, ..c }).collect();
        let photos =
            (0..n).map(|_| RgbImage::from_fn(width, height, |_, _| Rgb([(); 3].map(|()| next() as u8)))).collect();
        let points = PointCloud {
            positions: (0..5).map(|i| [f64::from(i), 0.5 - f64::from(i), 0.25]).collect(),
            colors: (0..5).map(|i| [10 * i, 255 - i, 7]).collect(),
        };
        Plain { names, cameras, photos, points }
    }

    pub fn write_photos(&self, folder: &Path, name: impl Fn(&str) -> String) {
        for (photo, original) in self.photos.iter().zip(&self.names) {
            save(&photo.clone().into(), &folder.join(name(original)));
        }
    }

    /// The line of a single camera with a model and its parameters.
    pub fn cameras_txt(&self, model: &str, params: &[f64]) -> String {
        let Camera { width, height, .. } = self.cameras[0];
        format!("# Camera list\n1 {model} {width} {height} {}\n", words(params))
    }

    fn pinhole(&self) -> [f64; 4] {
        let Camera { fx, fy, cx, cy, .. } = self.cameras[0];
        [fx, fy, cx, cy]
    }

    /// `points` is the line after each image.
    pub fn images_txt(&self, name: impl Fn(&str) -> String, points: &str) -> String {
        let mut text = String::from("# Image list\n");
        for (i, (camera, original)) in self.cameras.iter().zip(&self.names).enumerate() {
            writeln!(text, "{} {} 1 {}{points}", i + 1, words(&pose(camera)), name(original)).unwrap();
        }
        text
    }

    fn points_txt(&self) -> String {
        let points = self.points.positions.iter().zip(&self.points.colors).enumerate();
        let line = |(i, (p, c)): (usize, (&[f64; 3], &[u8; 3]))| {
            format!("{i} {} {} {} {} {} {} 0.5 1 2\n", p[0], p[1], p[2], c[0], c[1], c[2])
        };
        points.map(line).collect()
    }

    /// Writes a model's text files with this camera.
    fn model(&self, folder: &Path, model: &str, params: &[f64]) {
        put(&folder.join("cameras.txt"), self.cameras_txt(model, params));
        put(&folder.join("images.txt"), self.images_txt(str::to_owned, "\n"));
        put(&folder.join("points3D.txt"), self.points_txt());
    }

    fn binary(&self, folder: &Path) {
        let Camera { width, height, .. } = self.cameras[0];
        let mut cameras = 1u64.to_le_bytes().to_vec();
        cameras.extend([1u32, 1].iter().flat_map(|v| v.to_le_bytes()));
        cameras.extend([u64::from(width), u64::from(height)].iter().flat_map(|v| v.to_le_bytes()));
        cameras.extend(self.pinhole().iter().flat_map(|v| v.to_le_bytes()));
        put(&folder.join("cameras.bin"), cameras);
        let mut images = (self.names.len() as u64).to_le_bytes().to_vec();
        for (i, (camera, name)) in self.cameras.iter().zip(&self.names).enumerate() {
            images.extend((i as u32 + 1).to_le_bytes());
            images.extend(pose(camera).iter().flat_map(|v| v.to_le_bytes()));
            images.extend(1u32.to_le_bytes());
            images.extend(name.bytes().chain([0]));
            images.extend(1u64.to_le_bytes());
            images.extend([0; 24]);
        }
        put(&folder.join("images.bin"), images);
        let mut points = (self.points.positions.len() as u64).to_le_bytes().to_vec();
        for (i, (p, color)) in self.points.positions.iter().zip(&self.points.colors).enumerate() {
            points.extend((i as u64).to_le_bytes());
            points.extend(p.iter().flat_map(|v| v.to_le_bytes()));
            points.extend(color);
            points.extend(0.5f64.to_le_bytes());
            points.extend(0u64.to_le_bytes());
        }
        put(&folder.join("points3D.bin"), points);
    }

    /// A PLY of the points, with colors as bytes or floats.
    fn cloud(&self, float: bool) -> String {
        let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", self.points.positions.len());
        text += "property float x\nproperty float y\nproperty float z\n";
        let kind = if float { "float" } else { "uchar" };
        writeln!(text, "property {kind} red\nproperty {kind} green\nproperty {kind} blue\nend_header").unwrap();
        for (p, color) in self.points.positions.iter().zip(&self.points.colors) {
            let color = color.map(|c| if float { f64::from(c) / 255.0 } else { f64::from(c) });
            writeln!(text, "{} {}", words(p), words(&color)).unwrap();
        }
        text
    }

    /// transforms.json with these members, and frames that `frame` may extend.
    fn transforms(&self, all: Value, frame: impl Fn(usize, &mut Value)) -> Value {
        let frames: Vec<Value> = (0..self.names.len())
            .map(|i| {
                let camera = &self.cameras[i];
                let (turn, eye) = (camera.rotation.transpose(), camera.eye());
                // OpenGL's y and z point the other way.
                let row = |r: usize| [turn.row(r).x, -turn.row(r).y, -turn.row(r).z, eye[r]];
                let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
                let mut value = json!({"file_path": format!("images/{}", self.names[i]), "transform_matrix": matrix});
                frame(i, &mut value);
                value
            })
            .collect();
        let mut file = all;
        file["frames"] = frames.into();
        file
    }

    fn intrinsics(&self) -> Value {
        let Camera { width, height, fx, fy, cx, cy, .. } = self.cameras[0];
        json!({"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": width, "h": height, "ply_file_path": "points.ply"})
    }
}

fn words(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

fn pose(camera: &Camera) -> [f64; 7] {
    let (q, t) = (DQuat::from_mat3(&camera.rotation), camera.translation);
    [q.w, q.x, q.y, q.z, t.x, t.y, t.z]
}

pub fn put(path: &Path, contents: impl AsRef<[u8]>) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, contents).unwrap();
}

fn save(photo: &DynamicImage, path: &Path) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    photo.save(path).unwrap();
}

fn plain(root: &Path) -> Written {
    (root.to_owned(), DatasetOptions::default())
}

/// The text files of a model in one folder, and the photos in another.
fn placed(p: &Plain, root: &Path, model: &str, images: &str) -> Written {
    p.model(&root.join(model), "PINHOLE", &p.pinhole());
    p.write_photos(&root.join(images), str::to_owned);
    plain(root)
}

/// The plain form after `change` has edited its files.
fn changed(p: &Plain, root: &Path, change: impl FnOnce(&Path)) -> Written {
    let written = placed(p, root, "sparse/0", "images");
    change(root);
    written
}

/// The plain form with photos written differently.
fn photos(p: &Plain, root: &Path, write: impl Fn(&RgbImage, &Path)) -> Written {
    p.model(&root.join("sparse/0"), "PINHOLE", &p.pinhole());
    for (photo, name) in p.photos.iter().zip(&p.names) {
        let path = root.join("images").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        write(photo, &path);
    }
    plain(root)
}

fn with_alpha(photo: &RgbImage, path: &Path) {
    DynamicImage::from(photo.clone()).into_rgba8().save(path).unwrap();
}

/// A camera model whose parameters cause no distortion.
fn straight(p: &Plain, root: &Path, model: &str, params: &[f64]) -> Written {
    p.model(&root.join("sparse/0"), model, params);
    p.write_photos(&root.join("images"), str::to_owned);
    plain(root)
}

fn transforms(p: &Plain, root: &Path, file: &Value) -> Written {
    p.write_photos(&root.join("images"), str::to_owned);
    put(&root.join("points.ply"), p.cloud(false));
    put(&root.join("transforms.json"), file.to_string());
    plain(root)
}

fn other_ending(name: &str, ending: &str) -> String {
    Path::new(name).with_extension(ending).to_str().unwrap().to_owned()
}

/// Every 8th by name, the default without a list.
fn test_names(p: &Plain) -> Vec<&str> {
    p.names.iter().step_by(8).map(String::as_str).collect()
}

/// Writes the kind of this name.
pub fn write(plain: &Plain, root: &Path, kind: &str) -> Written {
    KINDS.iter().find(|(name, _)| *name == kind).unwrap().1(plain, root)
}

/// Ten photos, written as this kind.
pub fn ten(kind: &str) -> (Plain, TempDir, Written) {
    let (plain, folder) = (Plain::new(10, [8, 6], [9.0, 9.0], "sub", 1), tempfile::tempdir().unwrap());
    let written = write(&plain, folder.path(), kind);
    (plain, folder, written)
}

/// Applies a change to the transforms.json of the dataset in `root`.
pub fn edit(root: &Path, change: impl FnOnce(&mut Value)) {
    let path = root.join("transforms.json");
    let mut file = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    change(&mut file);
    put(&path, file.to_string());
}

pub type Kind = (&'static str, fn(&Plain, &Path) -> Written);

/// The first is the plain form.
pub const KINDS: [Kind; 41] = [
    ("COLMAP text", |p, root| changed(p, root, |_| {})),
    ("COLMAP binary", |p, root| {
        p.binary(&root.join("sparse/0"));
        p.write_photos(&root.join("images"), str::to_owned);
        plain(root)
    }),
    ("binary with text images", |p, root| {
        p.binary(&root.join("sparse/0"));
        fs::remove_file(root.join("sparse/0/images.bin")).unwrap();
        put(&root.join("sparse/0/images.txt"), p.images_txt(str::to_owned, "\n1.5 2 -1 3 4.5 17"));
        p.write_photos(&root.join("images"), str::to_owned);
        plain(root)
    }),
    ("CRLF and a byte order mark", |p, root| {
        changed(p, root, |root| {
            for name in ["cameras.txt", "images.txt", "points3D.txt"] {
                let path = root.join("sparse/0").join(name);
                let text = fs::read_to_string(&path).unwrap().replace('\n', "\r\n");
                put(&path, format!("\u{feff}{text}"));
            }
        })
    }),
    ("no lines of points", |p, root| {
        changed(p, root, |root| put(&root.join("sparse/0/images.txt"), p.images_txt(str::to_owned, "")))
    }),
    ("model in sparse", |p, root| placed(p, root, "sparse", "images")),
    ("model beside the photos", |p, root| placed(p, root, "", "images")),
    ("model in colmap/sparse/0", |p, root| placed(p, root, "colmap/sparse/0", "images")),
    ("model in sparse/1 only", |p, root| placed(p, root, "sparse/1", "images")),
    ("a second model", |p, root| {
        changed(p, root, |root| p.model(&root.join("sparse/1"), "PINHOLE", &[9.0, 9.0, 1.0, 1.0]))
    }),
    ("a model that is chosen", |p, root| {
        let _ = placed(p, root, "sparse/2", "images");
        p.model(&root.join("sparse/0"), "PINHOLE", &[9.0, 9.0, 1.0, 1.0]);
        (root.to_owned(), DatasetOptions { model: Some("sparse/2".into()), ..Default::default() })
    }),
    ("everything in dense", |p, root| placed(p, root, "dense/sparse", "dense/images")),
    ("photos in input", |p, root| placed(p, root, "sparse/0", "input")),
    ("photos in a folder that is named", |p, root| {
        changed(p, root, |root| fs::rename(root.join("images"), root.join("pictures")).unwrap());
        fs::create_dir(root.join("images")).unwrap();
        (root.to_owned(), DatasetOptions { images: Some("pictures".into()), ..Default::default() })
    }),
    ("reduced photos in images_4", |p, root| {
        // The model is for photos four times as large.
        let Camera { width, height, .. } = p.cameras[0];
        let camera = format!("1 PINHOLE {} {} {}\n", 4 * width, 4 * height, words(&p.pinhole().map(|v| 4.0 * v)));
        let written = placed(p, root, "sparse/0", "images_4");
        put(&root.join("sparse/0/cameras.txt"), camera);
        written
    }),
    ("backslashes", |p, root| {
        changed(p, root, |root| {
            let name = |name: &str| name.replace('/', "\\");
            put(&root.join("sparse/0/images.txt"), p.images_txt(name, "\n"));
        })
    }),
    ("files in another case", |p, root| {
        p.model(&root.join("sparse/0"), "PINHOLE", &p.pinhole());
        p.write_photos(&root.join("images"), str::to_uppercase);
        plain(root)
    }),
    ("files with another ending", |p, root| {
        p.model(&root.join("sparse/0"), "PINHOLE", &p.pinhole());
        p.write_photos(&root.join("images"), |name| other_ending(name, "bmp"));
        plain(root)
    }),
    ("WebP", |p, root| photos(p, root, |photo, path| photo.save_with_format(path, image::ImageFormat::WebP).unwrap())),
    ("TIFF", |p, root| photos(p, root, |photo, path| photo.save_with_format(path, image::ImageFormat::Tiff).unwrap())),
    ("BMP", |p, root| photos(p, root, |photo, path| photo.save_with_format(path, image::ImageFormat::Bmp).unwrap())),
    ("16 bits", |p, root| {
        photos(p, root, |photo, path| {
            let wide = photo.as_raw().iter().map(|&byte| u16::from(byte) * 257).collect();
            let wide: ImageBuffer<Rgb<u16>, Vec<u16>> =
                ImageBuffer::from_vec(photo.width(), photo.height(), wide).unwrap();
            wide.save(path).unwrap();
        })
    }),
    ("opaque alpha", |p, root| photos(p, root, with_alpha)),
    ("opaque alpha as a mask", |p, root| {
        let (root, options) = photos(p, root, with_alpha);
        (root, DatasetOptions { alpha: Alpha::Mask, ..options })
    }),
    ("white masks", |p, root| {
        changed(p, root, |root| {
            for name in &p.names {
                let white = image::GrayImage::from_pixel(p.cameras[0].width, p.cameras[0].height, image::Luma([255]));
                save(&white.into(), &root.join(format!("masks/{name}.png")));
            }
        })
    }),
    ("a photo that is missing", |p, root| {
        changed(p, root, |root| {
            let mut text = p.images_txt(str::to_owned, "\n");
            writeln!(text, "99 1 0 0 0 0 0 0 1 zz.png\n").unwrap();
            put(&root.join("sparse/0/images.txt"), text);
        })
    }),
    ("points in a PLY of float colors", |p, root| {
        changed(p, root, |root| {
            fs::remove_file(root.join("sparse/0/points3D.txt")).unwrap();
            put(&root.join("sparse/0/points3D.ply"), p.cloud(true));
        })
    }),
    ("test.txt", |p, root| {
        changed(p, root, |root| {
            let names: Vec<String> = test_names(p).iter().map(|name| other_ending(name, "")).collect();
            put(&root.join("sparse/0/test.txt"), format!("\u{feff}# for testing\r\n\r\n{}", names.join("\r\n")));
        })
    }),
    ("train.txt and test.txt", |p, root| {
        changed(p, root, |root| {
            put(&root.join("test.txt"), test_names(p).join("\n"));
            let train: Vec<&str> = p.names.iter().map(String::as_str).filter(|n| !test_names(p).contains(n)).collect();
            put(&root.join("train.txt"), train.join("\n"));
        })
    }),
    ("every 8th, said", |p, root| {
        let (root, options) = changed(p, root, |root| put(&root.join("test.txt"), "p01.png"));
        (root, DatasetOptions { holdout: Holdout::Every(8), ..options })
    }),
    ("OPENCV of zeros", |p, root| straight(p, root, "OPENCV", &[&p.pinhole()[..], &[0.0; 4]].concat())),
    ("FULL_OPENCV of zeros", |p, root| straight(p, root, "FULL_OPENCV", &[&p.pinhole()[..], &[0.0; 8]].concat())),
    ("DIVISION of zero", |p, root| straight(p, root, "DIVISION", &[&p.pinhole()[..], &[0.0]].concat())),
    ("EUCM of a pinhole", |p, root| straight(p, root, "EUCM", &[&p.pinhole()[..], &[0.0, 1.0]].concat())),
    ("FOV of zero", |p, root| straight(p, root, "FOV", &[&p.pinhole()[..], &[0.0]].concat())),
    ("nerfstudio", |p, root| transforms(p, root, &p.transforms(p.intrinsics(), |_, _| {}))),
    ("a JSON file that is named", |p, root| {
        let mut all = p.intrinsics();
        all["camera_model"] = json!("opencv");
        all["k4"] = json!(0);
        let (root, options) = transforms(p, root, &p.transforms(all, |_, _| {}));
        fs::rename(root.join("transforms.json"), root.join("views.JSON")).unwrap();
        (root.join("views.JSON"), options)
    }),
    ("intrinsics in frames, a byte order mark, backslashes, no endings", |p, root| {
        let file = p.transforms(json!({"ply_file_path": ".\\points.ply"}), |i, frame| {
            frame.as_object_mut().unwrap().extend(p.intrinsics().as_object().unwrap().clone());
            frame["ply_file_path"].take();
            frame["file_path"] = json!(format!(".\\images\\{}", other_ending(&p.names[i], "").replace('/', "\\")));
        });
        let written = transforms(p, root, &file);
        put(
            &root.join("transforms.json"),
            format!("\u{feff}{}", serde_json::to_string_pretty(&file).unwrap().replace('\n', "\r\n")),
        );
        written
    }),
    ("fields of view", |p, root| {
        let Camera { width, height, fx, fy, .. } = p.cameras[0];
        let mut all = p.intrinsics();
        all.as_object_mut().unwrap().retain(|key, _| !key.starts_with("fl_"));
        all["camera_angle_x"] = json!(2.0 * (0.5 * f64::from(width) / fx).atan());
        all["camera_angle_y"] = json!(2.0 * (0.5 * f64::from(height) / fy).atan());
        transforms(p, root, &p.transforms(all, |_, _| {}))
    }),
    ("a file for training and one for testing, of which one photo is in both", |p, root| {
        let tests = test_names(p);
        let part = |test: bool| {
            let mut file = p.transforms(p.intrinsics(), |_, _| {});
            let frames = file["frames"].as_array_mut().unwrap();
            let mut i = 0;
            frames.retain(|_| {
                i += 1;
                tests.contains(&&p.names[i - 1][..]) == test || i == 1
            });
            file.to_string()
        };
        let written = transforms(p, root, &json!({}));
        fs::remove_file(root.join("transforms.json")).unwrap();
        put(&root.join("transforms_train.json"), part(false));
        put(&root.join("transforms_test.json"), part(true));
        put(&root.join("transforms_val.json"), "{");
        written
    }),
    ("nerfstudio's lists", |p, root| {
        let of = |test: bool| -> Vec<String> {
            let names = p.names.iter().filter(|name| test_names(p).contains(&&name[..]) == test);
            names.map(|name| format!("images/{name}")).collect()
        };
        let mut all = p.intrinsics();
        (all["train_filenames"], all["test_filenames"]) = (json!(of(false)), json!(of(true)));
        all["val_filenames"] = json!(["images/p01.png"]);
        transforms(p, root, &p.transforms(all, |_, _| {}))
    }),
];
