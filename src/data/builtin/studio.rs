//! The studio of the built-in scene: lights, objects, floor, and the rays that see them.

use std::{
    f64::consts::{PI, SQRT_2, TAU},
    sync::OnceLock,
};

use glam::{DMat3, DVec2, DVec3, dvec2, dvec3};
use rayon::prelude::*;

use super::{Part, direction};
use crate::{
    data::srgb::{linear_from_srgb, srgb_from_linear},
    scene::Camera,
};

/// Background, 8-bit sRGB.
pub(super) const BACKGROUND: [u8; 3] = [30, 33, 41];
/// The floor is a disk; between the two radii it fades into the background.
const FLOOR_INNER: f64 = 1.9;
pub(super) const FLOOR_RADIUS: f64 = 2.7;
/// Edge of a checker field on the floor, scene units, and the half-width of its soft edge in the units of the
/// sine that makes it: 0.25 is 0.04 scene units, two pixels of a photograph.
const CHECKER: f64 = 0.5;
const CHECKER_SOFTNESS: f64 = 0.25;
/// Radiance of the studio straight up, as seen in reflections and as ambient light.
const ZENITH: DVec3 = dvec3(0.20, 0.22, 0.26);
/// Irradiance per radiance of the ambient light that reaches an unoccluded horizontal surface.
const AMBIENT: f64 = 1.1;
/// Samples per pixel are `SAMPLES`², on a regular grid.
const SAMPLES: usize = 4;
/// Texels of the baked floor irradiance along one axis; a texel is 0.034 scene units, 1.7 pixels.
const BAKE: usize = 160;
/// Shadow rays per texel: `BAKE_LIGHT`² per light, `BAKE_SKY` for the ambient light.
const BAKE_LIGHT: usize = 5;
const BAKE_SKY: usize = 64;

/// A rectangular light at infinity.
struct Light {
    /// Azimuth from the cameras' middle, elevation, half width, half height; degrees.
    place: [f64; 4],
    radiance: DVec3,
}

/// Key light, fill light, two lights behind the objects for reflections in flat tops, and a low one in front.
const LIGHTS: [Light; 5] = [
    Light { place: [-38.0, 58.0, 9.0, 9.0], radiance: dvec3(19.0, 17.6, 15.4) },
    Light { place: [48.0, 42.0, 6.0, 9.0], radiance: dvec3(13.0, 14.2, 16.0) },
    Light { place: [156.0, 37.0, 7.0, 7.0], radiance: dvec3(17.0, 16.0, 14.5) },
    Light { place: [200.0, 46.0, 7.0, 7.0], radiance: dvec3(14.0, 15.0, 16.5) },
    Light { place: [4.0, 76.0, 7.0, 7.0], radiance: dvec3(15.0, 15.0, 15.0) },
];

/// A convex shape; the point cloud relies on convexity.
pub(super) enum Shape {
    Ellipsoid {
        centre: DVec3,
        radii: DVec3,
    },
    Capsule {
        a: DVec3,
        b: DVec3,
        radius: f64,
    },
    /// Half sizes include the rounding; `yaw` turns about z, radians.
    RoundedBox {
        centre: DVec3,
        half: DVec3,
        rounding: f64,
        yaw: f64,
    },
}

pub(super) enum Albedo {
    Plain(DVec3),
    /// Soft bands of two colors along z, `per_unit` pairs in a scene unit.
    Bands {
        a: DVec3,
        b: DVec3,
        per_unit: f64,
    },
    /// Smooth blotches of two colors, `scale` the wave number in 1/scene units.
    Marble {
        a: DVec3,
        b: DVec3,
        scale: f64,
    },
}

pub(super) struct Object {
    pub(super) shape: Shape,
    pub(super) albedo: Albedo,
    /// Reflectance at normal incidence (Schlick 1994). 0 means no reflection, even at grazing angles.
    pub(super) f0: DVec3,
    /// Standard deviation of the reflected lobe, radians. Below [`MIRROR`] reflected rays are traced.
    pub(super) blur: f64,
}

/// Up to 3.4° reflections are shown sharp, as their blur would be about a pixel on these small curved bodies.
const MIRROR: f64 = 0.06;

/// The objects of the built-in scene.
pub(super) fn objects() -> Vec<Object> {
    let degrees = |d: f64| d.to_radians();
    let on_floor = |x: f64, y: f64, radii: DVec3| Shape::Ellipsoid { centre: dvec3(x, y, radii.z), radii };
    let plate_top = 0.14;
    vec![
        // Chrome.
        Object {
            shape: on_floor(-0.36, 0.70, DVec3::splat(0.38)),
            albedo: Albedo::Plain(DVec3::ZERO),
            f0: dvec3(0.62, 0.63, 0.66),
            blur: degrees(3.0),
        },
        // Red lacquer.
        Object {
            shape: on_floor(-1.04, 0.02, DVec3::splat(0.40)),
            albedo: Albedo::Plain(dvec3(0.42, 0.035, 0.030)),
            f0: DVec3::splat(0.06),
            blur: degrees(4.5),
        },
        // Banded teal pebble.
        Object {
            shape: on_floor(1.04, -0.04, dvec3(0.47, 0.42, 0.26)),
            albedo: Albedo::Bands { a: dvec3(0.02, 0.20, 0.22), b: dvec3(0.05, 0.33, 0.30), per_unit: 6.0 },
            f0: DVec3::splat(0.06),
            blur: degrees(5.0),
        },
        // Black lacquered plate.
        Object {
            shape: Shape::RoundedBox {
                centre: dvec3(-0.02, -0.62, 0.5 * plate_top),
                half: dvec3(0.70, 0.45, 0.5 * plate_top),
                rounding: 0.06,
                yaw: degrees(14.0),
            },
            albedo: Albedo::Plain(dvec3(0.018, 0.017, 0.020)),
            f0: DVec3::splat(0.07),
            blur: degrees(6.0),
        },
        // Brushed gold capsule, standing.
        Object {
            shape: Shape::Capsule { a: dvec3(1.02, 0.86, 0.22), b: dvec3(1.02, 0.86, 0.62), radius: 0.22 },
            albedo: Albedo::Plain(dvec3(0.08, 0.05, 0.015)),
            f0: dvec3(0.62, 0.42, 0.16),
            blur: degrees(7.0),
        },
        // Marbled ceramic on the plate.
        Object {
            shape: Shape::Ellipsoid { centre: dvec3(0.25, -0.55, plate_top + 0.20), radii: DVec3::splat(0.20) },
            albedo: Albedo::Marble { a: dvec3(0.36, 0.37, 0.36), b: dvec3(0.05, 0.09, 0.26), scale: 11.0 },
            f0: DVec3::splat(0.055),
            blur: degrees(4.0),
        },
        // Satin copper pebble on the plate.
        Object {
            shape: Shape::Ellipsoid { centre: dvec3(-0.34, -0.74, plate_top + 0.11), radii: dvec3(0.19, 0.15, 0.11) },
            albedo: Albedo::Plain(dvec3(0.06, 0.022, 0.014)),
            f0: dvec3(0.58, 0.30, 0.20),
            blur: degrees(6.0),
        },
        // Blue lacquered box.
        Object {
            shape: Shape::RoundedBox {
                centre: dvec3(0.38, 0.92, 0.24),
                half: dvec3(0.30, 0.30, 0.24),
                rounding: 0.09,
                yaw: degrees(-24.0),
            },
            albedo: Albedo::Plain(dvec3(0.025, 0.06, 0.22)),
            f0: DVec3::splat(0.07),
            blur: degrees(6.0),
        },
    ]
}

/// A camera with its precomputed centre, needed by every ray.
pub(super) struct View<'a> {
    pub(super) camera: &'a Camera,
    pub(super) eye: DVec3,
}

/// Result of a ray: an identifier of the object it hits, total light and diffuse light; both clipped at
/// white.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    hit: usize,
    all: DVec3,
    diffuse: DVec3,
}

/// A light ready for evaluation: its frame, half sizes as tangents, and its irradiance at normal incidence.
struct Lamp {
    toward: DVec3,
    right: DVec3,
    up: DVec3,
    half: DVec2,
    radiance: DVec3,
    irradiance: DVec3,
}

impl Lamp {
    fn new(light: &Light) -> Lamp {
        let [azimuth, elevation, half_width, half_height] = light.place;
        let toward = direction(azimuth, elevation);
        let right = toward.cross(DVec3::Z).normalize();
        let half = dvec2(half_width.to_radians().tan(), half_height.to_radians().tan());
        Lamp {
            toward,
            right,
            up: right.cross(toward),
            half,
            radiance: light.radiance,
            irradiance: light.radiance * (4.0 * half.x * half.y),
        }
    }

    /// The fraction of a Gaussian lobe of standard deviation `blur` about `r` that falls on the light.
    fn share(&self, r: DVec3, blur: f64) -> f64 {
        let w = r.dot(self.toward);
        if w <= 0.1 {
            return 0.0;
        }
        let (x, y) = ((r.dot(self.right) / w).abs(), (r.dot(self.up) / w).abs());
        // Beyond five standard deviations the fraction is below 1e-6, a thousandth of an 8-bit step at
        // radiance 19.
        if x > self.half.x + 5.0 * blur || y > self.half.y + 5.0 * blur {
            return 0.0;
        }
        let s = 1.0 / (SQRT_2 * blur);
        let band = |x: f64, half: f64| 0.5 * (erf((half - x) * s) + erf((half + x) * s));
        band(x, self.half.x) * band(y, self.half.y)
    }
}

/// Error function, Abramowitz and Stegun 7.1.26, absolute error below 1.5e-7.
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.3275911 * x.abs());
    let poly = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
    (1.0 - poly * (-x * x).exp()).copysign(x)
}

fn smoothstep(lo: f64, hi: f64, x: f64) -> f64 {
    let t = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

pub(super) fn to_byte(linear: f64) -> u8 {
    (srgb_from_linear(linear) * 255.0).round().clamp(0.0, 255.0) as u8
}

fn background() -> DVec3 {
    DVec3::from_array(BACKGROUND.map(|b| linear_from_srgb(b as f64 / 255.0)))
}

impl Albedo {
    /// `p` relative to the object's centre.
    fn at(&self, p: DVec3) -> DVec3 {
        match self {
            Albedo::Plain(c) => *c,
            Albedo::Bands { a, b, per_unit } => a.lerp(*b, smoothstep(-0.6, 0.6, (TAU * per_unit * p.z).sin())),
            Albedo::Marble { a, b, scale } => {
                let q = p * *scale;
                let warp = (q.y * 0.8 + (q.z * 0.9).sin()).sin() + (q.z * 1.1 - q.x * 0.7).sin();
                a.lerp(*b, smoothstep(-0.7, 0.7, (q.x + q.z * 0.6 + 1.2 * warp).sin()))
            }
        }
    }

    pub(super) fn mean(&self) -> DVec3 {
        match self {
            Albedo::Plain(c) => *c,
            Albedo::Bands { a, b, .. } | Albedo::Marble { a, b, .. } => 0.5 * (*a + *b),
        }
    }
}

/// Nearest non-negative entry of a ray into a sphere; `None` from inside.
fn enter_sphere(o: DVec3, d: DVec3, centre: DVec3, radius: f64) -> Option<f64> {
    let oc = o - centre;
    let b = oc.dot(d);
    let h = radius * radius - (oc - b * d).length_squared();
    let t = -b - h.max(0.0).sqrt();
    (h >= 0.0 && t >= 0.0).then_some(t)
}

impl Shape {
    pub(super) fn centre(&self) -> DVec3 {
        match self {
            Shape::Ellipsoid { centre, .. } | Shape::RoundedBox { centre, .. } => *centre,
            Shape::Capsule { a, b, .. } => 0.5 * (*a + *b),
        }
    }

    pub(super) fn bounding_radius(&self) -> f64 {
        match self {
            Shape::Ellipsoid { radii, .. } => radii.max_element(),
            Shape::Capsule { a, b, radius } => 0.5 * a.distance(*b) + radius,
            Shape::RoundedBox { half, .. } => half.length(),
        }
    }

    /// Entry of the ray from outside: distance and outward normal. `d` is a unit vector.
    pub(super) fn enter(&self, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
        match self {
            Shape::Ellipsoid { centre, radii } => {
                let (o, d) = ((o - *centre) / *radii, d / *radii);
                let stretch = d.length();
                let t = enter_sphere(o, d / stretch, DVec3::ZERO, 1.0)? / stretch;
                Some((t, ((o + t * d) / *radii).normalize()))
            }
            Shape::Capsule { a, b, radius } => {
                let axis = (*b - *a).normalize();
                let length = a.distance(*b);
                let normal = |t: f64| {
                    let p = o + t * d;
                    let along = (p - *a).dot(axis).clamp(0.0, length);
                    (p - (*a + along * axis)) / *radius
                };
                // The side, if the ray enters between the two ends.
                let (oa, dp) = (o - *a, d - d.dot(axis) * axis);
                let op = oa - oa.dot(axis) * axis;
                let (qa, qb, qc) = (dp.length_squared(), op.dot(dp), op.length_squared() - radius * radius);
                let h = qb * qb - qa * qc;
                if h >= 0.0 && qa > 1e-12 {
                    let t = (-qb - h.sqrt()) / qa;
                    let along = (oa + t * d).dot(axis);
                    if t >= 0.0 && (0.0..=length).contains(&along) {
                        return Some((t, normal(t)));
                    }
                }
                let ends = [enter_sphere(o, d, *a, *radius), enter_sphere(o, d, *b, *radius)];
                let t = ends.into_iter().flatten().min_by(f64::total_cmp)?;
                Some((t, normal(t)))
            }
            Shape::RoundedBox { centre, half, rounding, yaw } => {
                let turn = DMat3::from_rotation_z(*yaw);
                let (o, d) = (turn.transpose() * (o - *centre), turn.transpose() * d);
                // Start at the plain box around it, then step by the distance, which never oversteps a convex
                // shape.
                let inverse = d.recip();
                let (p, q) = ((-*half - o) * inverse, (*half - o) * inverse);
                let (t_in, t_out) = (p.min(q).max_element(), p.max(q).min_element());
                if !(t_in <= t_out && t_out >= 0.0) {
                    return None;
                }
                let core = *half - DVec3::splat(*rounding);
                let nearest = |x: DVec3| (x.abs() - core).max(DVec3::ZERO);
                let mut t = t_in.max(0.0);
                if t_in < 0.0 && nearest(o).length() <= *rounding {
                    return None;
                }
                // Grazing rays converge slowly; 64 steps lose only a few that pass near the silhouette.
                for _ in 0..64 {
                    let x = o + t * d;
                    let q = nearest(x);
                    let distance = q.length() - rounding;
                    if distance < 1e-7 {
                        return Some((t, turn * (q.normalize_or(DVec3::Z) * x.signum())));
                    }
                    t += distance;
                    if t > t_out {
                        return None;
                    }
                }
                None
            }
        }
    }

    /// Spheres that replace the shape for shadows on other objects.
    fn proxies(&self) -> Vec<(DVec3, f64)> {
        match self {
            Shape::Ellipsoid { centre, radii } => vec![(*centre, (radii.x * radii.y * radii.z).cbrt())],
            Shape::Capsule { a, b, radius } => vec![(*a, *radius), (0.5 * (*a + *b), *radius), (*b, *radius)],
            // A low plate only shades the floor, whose shading is traced.
            Shape::RoundedBox { half, .. } if half.z < 0.5 * half.x => vec![],
            Shape::RoundedBox { centre, half, .. } => vec![(*centre, (half.x * half.y * half.z).cbrt() * 1.2)],
        }
    }
}

pub(super) struct Studio {
    pub(super) objects: Vec<Object>,
    lamps: Vec<Lamp>,
    proxies: Vec<Vec<(DVec3, f64)>>,
    background: DVec3,
    /// Irradiance / π of the floor, `BAKE`² texels over the square of half side [`FLOOR_RADIUS`].
    floor: Vec<DVec3>,
}

/// Intersection of a ray. `object` is `None` for the floor.
pub(super) struct Hit {
    object: Option<usize>,
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
}

/// The studio of the built-in scene, a constant that is prepared at the first use.
pub(super) fn studio() -> &'static Studio {
    static STUDIO: OnceLock<Studio> = OnceLock::new();
    STUDIO.get_or_init(|| Studio::new(objects(), background()))
}

impl Studio {
    /// A studio with these objects on its floor. `background` is linear light.
    pub(super) fn new(objects: Vec<Object>, background: DVec3) -> Studio {
        let proxies = objects.iter().map(|o| o.shape.proxies()).collect();
        let lamps = LIGHTS.iter().map(Lamp::new).collect();
        let mut studio = Studio { objects, lamps, proxies, background, floor: vec![] };
        studio.floor = studio.bake_floor();
        studio
    }

    /// The first object that the ray enters: index, distance, normal.
    pub(super) fn enter(&self, o: DVec3, d: DVec3) -> Option<(usize, f64, DVec3)> {
        let mut best: Option<(usize, f64, DVec3)> = None;
        for (i, object) in self.objects.iter().enumerate() {
            let (oc, radius) = (object.shape.centre() - o, object.shape.bounding_radius());
            let along = oc.dot(d);
            if along < -radius || oc.length_squared() - along * along > radius * radius {
                continue;
            }
            if let Some((t, n)) = object.shape.enter(o, d)
                && best.is_none_or(|b| t < b.1)
            {
                best = Some((i, t, n));
            }
        }
        best
    }

    /// The object between `p` and infinity in direction `d`. Traced from outside, so that it also finds an
    /// object around `p`.
    fn occluder(&self, p: DVec3, d: DVec3) -> Option<usize> {
        let far = 4.0 * FLOOR_RADIUS;
        self.enter(p + far * d, -d).filter(|(_, t, _)| *t < far).map(|(i, ..)| i)
    }

    pub(super) fn trace(&self, o: DVec3, d: DVec3) -> Option<Hit> {
        let object = self.enter(o, d);
        let floor = (d.z < 0.0).then(|| -o.z / d.z).filter(|t| *t > 0.0 && (o + *t * d).length() < FLOOR_RADIUS);
        match (object, floor) {
            (Some((i, t, normal)), floor) if floor.is_none_or(|f| t < f) => {
                Some(Hit { object: Some(i), point: o + t * d, normal })
            }
            (_, Some(t)) => Some(Hit { object: None, point: o + t * d, normal: DVec3::Z }),
            _ => None,
        }
    }

    /// Radiance of the studio without lights and objects.
    fn sky(&self, up: f64) -> DVec3 {
        self.background.lerp(ZENITH, smoothstep(0.0, 0.9, up))
    }

    fn bake_floor(&self) -> Vec<DVec3> {
        let texel = 2.0 * FLOOR_RADIUS / BAKE as f64;
        (0..BAKE * BAKE)
            .into_par_iter()
            .map(|i| {
                let (x, y) = ((i % BAKE) as f64 + 0.5, (i / BAKE) as f64 + 0.5);
                let p = dvec3(x * texel - FLOOR_RADIUS, y * texel - FLOOR_RADIUS, 0.0);
                // Beyond the disk, interpolation at its rim reads only the nearest texels.
                if p.length() > FLOOR_RADIUS + 2.0 * texel { DVec3::ZERO } else { self.floor_light(p) }
            })
            .collect()
    }

    /// Irradiance / π at a point of the floor, by a fixed pattern of shadow rays.
    fn floor_light(&self, p: DVec3) -> DVec3 {
        // Raised a little, so that objects on the floor shade it only at their contact area.
        let o = p + dvec3(0.0, 0.0, 1e-4);
        let mut light = DVec3::ZERO;
        for lamp in &self.lamps {
            let mut open = 0;
            for k in 0..BAKE_LIGHT * BAKE_LIGHT {
                let at = |k: usize| (k as f64 + 0.5) / BAKE_LIGHT as f64 * 2.0 - 1.0;
                let (u, v) = (at(k % BAKE_LIGHT) * lamp.half.x, at(k / BAKE_LIGHT) * lamp.half.y);
                let toward = (lamp.toward + u * lamp.right + v * lamp.up).normalize();
                open += self.occluder(o, toward).is_none() as usize;
            }
            light += lamp.irradiance * (lamp.toward.z / PI * open as f64 / (BAKE_LIGHT * BAKE_LIGHT) as f64);
        }
        // Cosine-weighted directions on a Fibonacci spiral.
        let golden = PI * (3.0 - 5f64.sqrt());
        for k in 0..BAKE_SKY {
            let s = (k as f64 + 0.5) / BAKE_SKY as f64;
            let (sin, cos) = (golden * k as f64).sin_cos();
            let d = dvec3(cos * s.sqrt(), sin * s.sqrt(), (1.0 - s).sqrt());
            let seen = match self.occluder(o, d) {
                // Color that an object bleeds onto the floor next to it.
                Some(i) => 0.25 * self.objects[i].albedo.mean(),
                None => AMBIENT * self.sky(d.z),
            };
            light += seen / BAKE_SKY as f64;
        }
        light
    }

    /// Baked irradiance / π below `p`, bilinear.
    fn floor_irradiance(&self, p: DVec3) -> DVec3 {
        let scale = BAKE as f64 / (2.0 * FLOOR_RADIUS);
        let at = |v: f64| ((v + FLOOR_RADIUS) * scale - 0.5).clamp(0.0, (BAKE - 1) as f64 - 1e-9);
        let (x, y) = (at(p.x), at(p.y));
        let (i, j) = (x as usize, y as usize);
        let row = |j: usize| self.floor[j * BAKE + i].lerp(self.floor[j * BAKE + i + 1], x - i as f64);
        row(j).lerp(row(j + 1), y - j as f64)
    }

    /// Radiance of the floor at `p`; `blurred` leaves out its pattern.
    fn floor_radiance(&self, p: DVec3, blurred: bool) -> DVec3 {
        let (light, dark) = (dvec3(0.27, 0.255, 0.235), dvec3(0.13, 0.128, 0.13));
        let share = if blurred {
            0.5
        } else {
            let wave = |v: f64| (PI * v / CHECKER).sin() / CHECKER_SOFTNESS;
            // A product of two soft square waves.
            0.5 + 0.5 * wave(p.x + 0.1).tanh() * wave(p.y + 0.1).tanh()
        };
        let lit = dark.lerp(light, share) * self.floor_irradiance(p);
        lit.lerp(self.background, smoothstep(FLOOR_INNER, FLOOR_RADIUS, p.truncate().length()))
    }

    /// Fraction of lamp `k`'s light that reaches a point of object `own` past the other objects' proxy
    /// spheres.
    fn reach(&self, own: usize, p: DVec3, lamp: &Lamp) -> f64 {
        let mut open = 1.0;
        let spread = 0.5 * (lamp.half.x + lamp.half.y);
        for (_, proxies) in self.proxies.iter().enumerate().filter(|(i, _)| *i != own) {
            for (centre, radius) in proxies {
                let to = *centre - p;
                let along = to.dot(lamp.toward);
                if along > 0.0 {
                    let off = (to - along * lamp.toward).length();
                    let soft = spread * along + 0.02;
                    open *= smoothstep(radius - soft, radius + soft, off);
                }
            }
        }
        open
    }

    /// Ambient light at a point of object `own`: the fraction that the other objects leave (a sphere of
    /// radius R at distance d blocks cos · (R/d)² of it).
    fn openness(&self, own: usize, p: DVec3, n: DVec3) -> f64 {
        let mut open = 1.0;
        for (_, proxies) in self.proxies.iter().enumerate().filter(|(i, _)| *i != own) {
            for (centre, radius) in proxies {
                let to = *centre - p;
                let square = to.length_squared().max(radius * radius);
                open *= 1.0 - (n.dot(to) / square.sqrt()).max(0.0) * radius * radius / square;
            }
        }
        open
    }

    /// Diffuse and specular light that the hit point sends back along the ray; `d` is the ray's unit
    /// direction. `bounces` limits the number of traced mirror-like reflections.
    pub(super) fn shade(&self, hit: &Hit, d: DVec3, bounces: u32) -> (DVec3, DVec3) {
        let Some(index) = hit.object else {
            return (self.floor_radiance(hit.point, false), DVec3::ZERO);
        };
        let object = &self.objects[index];
        let (p, n) = (hit.point, hit.normal);
        let r = d - 2.0 * d.dot(n) * n;
        let open = self.openness(index, p, n);

        let up = 0.5 + 0.5 * n.z;
        let mut diffuse = self.sky(n.z) * (AMBIENT * up * open) + self.floor_radiance(p, true) * (1.0 - up);
        let mut specular = DVec3::ZERO;
        for lamp in &self.lamps {
            let (cosine, share) = (n.dot(lamp.toward), lamp.share(r, object.blur));
            if cosine <= 0.0 && share == 0.0 {
                continue;
            }
            let reach = self.reach(index, p, lamp);
            diffuse += lamp.irradiance * (cosine.max(0.0) / PI * reach);
            specular += lamp.radiance * (share * reach);
        }
        diffuse *= object.albedo.at(p - object.shape.centre());
        if object.f0 == DVec3::ZERO {
            return (diffuse, DVec3::ZERO);
        }

        if object.blur < MIRROR && bounces > 0 {
            let seen = match self.trace(p + 1e-6 * n, r) {
                Some(hit) => {
                    let (a, b) = self.shade(&hit, r, bounces - 1);
                    // The reflected ray hits something in front of the lamps.
                    specular = DVec3::ZERO;
                    a + b
                }
                None => self.sky(r.z),
            };
            specular += seen;
        } else {
            // The blurred lobe mixes sky and floor by the fractions of its Gaussian above and below the
            // horizon.
            let above = 0.5 + 0.5 * erf(r.z / (SQRT_2 * object.blur));
            let floor = p + r * (p.z / (-r.z).max(0.05));
            let floor = if floor.truncate().length() < FLOOR_RADIUS {
                self.floor_radiance(floor, true)
            } else {
                self.background
            };
            specular += (self.sky(r.z) * above + floor * (1.0 - above)) * open;
        }
        let grazing = (1.0 + d.dot(n)).clamp(0.0, 1.0).powi(5);
        (diffuse, specular * (object.f0 + (DVec3::ONE - object.f0) * grazing))
    }

    pub(super) fn sample(&self, view: &View, x: f64, y: f64) -> Sample {
        let d = (view.camera.unproject(x, y, 1.0) - view.eye).normalize();
        match self.trace(view.eye, d) {
            None => Sample { hit: usize::MAX, all: self.background, diffuse: self.background },
            Some(hit) => {
                let (diffuse, specular) = self.shade(&hit, d, 1);
                let all = (diffuse + specular).min(DVec3::ONE);
                Sample { hit: hit.object.unwrap_or(self.objects.len()), all, diffuse: diffuse.min(DVec3::ONE) }
            }
        }
    }

    /// Mean light of a pixel's samples: four in a rotated grid if the pixel's corners are alike, otherwise
    /// all.
    pub(super) fn pixel(&self, view: &View, x: f64, y: f64, part: Part, corners: [Sample; 4], calm: f64) -> DVec3 {
        let at = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
        let sample = |i: usize, j: usize| {
            let Sample { all, diffuse, .. } = self.sample(view, x + at(i), y + at(j));
            match part {
                Part::All => all,
                Part::Diffuse => diffuse,
                Part::Specular => all - diffuse,
            }
        };
        // The square root is near enough to sRGB.
        let root = corners.map(|s| s.all.map(f64::sqrt));
        let range = root.into_iter().reduce(DVec3::max).zip(root.into_iter().reduce(DVec3::min));
        let alike = corners.iter().all(|s| s.hit == corners[0].hit);
        if alike && range.is_some_and(|(hi, lo)| (hi - lo).max_element() < calm) {
            return (sample(1, 0) + sample(3, 1) + sample(0, 2) + sample(2, 3)) / 4.0;
        }
        let sum: DVec3 = (0..SAMPLES * SAMPLES).map(|k| sample(k % SAMPLES, k / SAMPLES)).sum();
        sum / (SAMPLES * SAMPLES) as f64
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::{super::points::gauss, *};

    #[test]
    fn rays_enter_shapes_at_their_surface() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for object in objects() {
            let (centre, radius) = (object.shape.centre(), object.shape.bounding_radius());
            let mut hits = 0;
            for _ in 0..200 {
                let d = dvec3(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)).normalize();
                let aim = centre + 0.3 * radius * dvec3(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng));
                let o = aim - 5.0 * d;
                let Some((t, n)) = object.shape.enter(o, d) else { continue };
                hits += 1;
                assert!((n.length() - 1.0).abs() < 1e-6 && n.dot(d) <= 1e-6, "normal {n} for ray {d}");
                let p = o + t * d;
                assert!(p.distance(centre) <= radius + 1e-9);
                // A line that starts a little inside does not enter again; one that starts a little outside
                // enters at once.
                let again = object.shape.enter(p + 1e-4 * n, -n).map_or(f64::INFINITY, |(t, _)| t);
                assert!((again - 1e-4).abs() < 1e-6, "entered again after {again}");
            }
            assert!(hits > 50, "{hits} of 200 rays hit");
        }
    }

    #[test]
    fn error_function_is_as_tabled() {
        // Abramowitz and Stegun, table 7.1.
        for (x, y) in [(0.0, 0.0), (0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650)] {
            assert!((erf(x) - y).abs() < 1.5e-7 && (erf(-x) + y).abs() < 1.5e-7);
        }
    }

    #[test]
    fn the_background_survives_the_photograph() {
        assert_eq!(background().to_array().map(to_byte), BACKGROUND);
    }
}
