//! Camera motion in the window: orbiting a point, flying, or walking on the ground.

use glam::{DMat3, DVec3};

use crate::scene::Camera;

/// Turn of the view for a drag over the window's height, radians.
const TURN: f64 = 2.0;
/// Minimum angle to straight up and straight down, radians. At the poles, left and right would swap.
const POLE: f64 = 0.02;
/// Factor of the distance or the speed for a notch of the wheel.
const NOTCH: f64 = 1.15;
/// Initial speed, in orbit distances per second.
const SPEED: f64 = 0.5;
/// Range of the distance and speed set by the wheel, relative to their initial values.
const REACH: [f64; 2] = [1e-3, 1e3];

/// Effect of mouse and keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    /// The mouse orbits a point.
    Orbit,
    /// The mouse looks around; keys move along the view.
    Fly,
    /// The mouse looks around; keys move along the ground.
    Walk,
}

impl Motion {
    pub(super) fn name(self) -> &'static str {
        match self {
            Motion::Orbit => "orbit",
            Motion::Fly => "fly",
            Motion::Walk => "walk",
        }
    }
}

/// Camera and its state of motion.
#[derive(Debug, Clone)]
pub(super) struct Flight {
    pub(super) motion: Motion,
    camera: Camera,
    /// Upward direction, of unit length.
    up: DVec3,
    /// Distance from the camera to the orbited point ahead of it, scene units.
    distance: f64,
    /// Initial distance.
    scale: f64,
    /// Speed, scene units per second.
    speed: f64,
}

impl Flight {
    /// Starts at `camera`, looking at a point near `pivot`.
    pub(super) fn new(camera: Camera, pivot: DVec3, up: DVec3) -> Self {
        let mut flight = Flight {
            motion: Motion::Orbit,
            camera,
            up: up.try_normalize().unwrap_or(DVec3::NEG_Y),
            distance: 1.0,
            scale: 1.0,
            speed: SPEED,
        };
        flight.jump(camera, pivot);
        flight.scale = flight.distance;
        flight.speed = SPEED * flight.scale;
        flight
    }

    pub(super) fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Moves to another camera; the point it looks at near `pivot` becomes the orbited one.
    pub(super) fn jump(&mut self, camera: Camera, pivot: DVec3) {
        self.camera = camera;
        let (ahead, away) = ((pivot - camera.eye()).dot(self.forward()), pivot.distance(camera.eye()));
        // A camera that looks past the point orbits a point at the same distance.
        let distance = if ahead > 0.1 * away { ahead } else { away };
        self.distance = if distance > 0.0 && distance.is_finite() { distance } else { 1.0 };
    }

    fn forward(&self) -> DVec3 {
        self.camera.rotation.row(2)
    }

    fn place(&mut self, rotation: DMat3, eye: DVec3) {
        // Orthonormalizes the rotation, which many small turns would distort.
        let z = rotation.row(2).normalize();
        let x = (rotation.row(0) - rotation.row(0).dot(z) * z).normalize();
        self.camera.rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
        self.camera.translation = -(self.camera.rotation * eye);
    }

    /// Drags by fractions of the window's height, to the right and down.
    pub(super) fn drag(&mut self, right: f64, down: f64) {
        let eye = self.camera.eye();
        let pivot = eye + self.distance * self.forward();
        // The view turns right and down with the mouse. In an orbit, points in front of the pivot follow
        // the mouse.
        let from_pole = self.forward().dot(self.up).clamp(-1.0, 1.0).acos();
        // A photo's camera may be beyond a pole. A drag then only brings the view back.
        let (least, most) = (from_pole.min(POLE), from_pole.max(std::f64::consts::PI - POLE));
        let pitch = (from_pole + TURN * down).clamp(least, most) - from_pole;
        let across = self.up.cross(self.forward()).try_normalize().unwrap_or(-self.camera.rotation.row(0));
        let turn = DMat3::from_axis_angle(self.up, -TURN * right) * DMat3::from_axis_angle(across, pitch);
        let rotation = self.camera.rotation * turn.transpose();
        let eye = match self.motion {
            Motion::Orbit => pivot + turn * (eye - pivot),
            Motion::Fly | Motion::Walk => eye,
        };
        self.place(rotation, eye);
    }

    /// Moves the scene with the mouse, by pixels of the camera's picture.
    pub(super) fn pan(&mut self, right: f64, down: f64) {
        let Camera { rotation, fx, fy, .. } = self.camera;
        let moved = rotation.row(0) * (right / fx) + rotation.row(1) * (down / fy);
        self.place(rotation, self.camera.eye() - self.distance * moved);
    }

    /// Turns the wheel away by `notches`. Returns whether the camera moved; in flight only its speed
    /// changes.
    pub(super) fn wheel(&mut self, notches: f64) -> bool {
        match self.motion {
            Motion::Orbit => {
                let [least, most] = REACH.map(|reach| reach * self.scale);
                let distance = (self.distance * NOTCH.powf(-notches)).clamp(least, most);
                let eye = self.camera.eye() + (self.distance - distance) * self.forward();
                self.distance = distance;
                self.place(self.camera.rotation, eye);
                true
            }
            Motion::Fly | Motion::Walk => {
                let [least, most] = REACH.map(|reach| reach * self.scale);
                self.speed = (self.speed * NOTCH.powf(notches)).clamp(least, most);
                false
            }
        }
    }

    /// Moves by keys held for `seconds`: to the right, up and ahead, each −1, 0 or 1 (more with Shift).
    pub(super) fn go(&mut self, [right, up, ahead]: [f64; 3], seconds: f64) {
        let Camera { rotation, .. } = self.camera;
        let flat = |v: DVec3| (v - v.dot(self.up) * self.up).normalize_or_zero();
        let (side, front, above) = match self.motion {
            Motion::Walk => (flat(rotation.row(0)), flat(rotation.row(2)), self.up),
            Motion::Orbit | Motion::Fly => (rotation.row(0), rotation.row(2), -rotation.row(1)),
        };
        let step = self.speed * seconds * (right * side + up * above + ahead * front);
        self.place(rotation, self.camera.eye() + step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Camera 4 units before the origin, looking at it, with y down.
    fn flight() -> Flight {
        let camera = Camera { translation: DVec3::new(0.0, 0.0, 4.0), ..Camera::new(64, 48, 50.0) };
        Flight::new(camera, DVec3::ZERO, DVec3::NEG_Y)
    }

    fn is_rotation(camera: &Camera) -> bool {
        let r = camera.rotation;
        let off = r * r.transpose() - DMat3::IDENTITY;
        off.to_cols_array().iter().all(|v| v.abs() < 1e-12) && r.determinant() > 0.0
    }

    #[test]
    fn an_orbit_keeps_its_distance_and_looks_at_its_point() {
        let mut flight = flight();
        for i in 0..200 {
            flight.drag(0.03, if i < 100 { 0.05 } else { -0.05 });
            let camera = flight.camera();
            assert!((camera.eye().length() - 4.0).abs() < 1e-9 && is_rotation(camera));
            let (x, y, z) = camera.project(DVec3::ZERO);
            assert!((x - 32.0).abs() < 1e-9 && (y - 24.0).abs() < 1e-9 && z > 0.0);
            // Never upside down.
            assert!(camera.rotation.row(1).dot(DVec3::NEG_Y) <= 0.0);
        }
        // The camera has left the pole.
        assert!(flight.forward().dot(DVec3::NEG_Y) > 0.9);
    }

    #[test]
    fn a_drag_turns_by_its_length_and_a_wheel_reaches_as_far_as_the_scene_asks() {
        let mut flight = flight();
        flight.motion = Motion::Fly;
        let before = flight.forward();
        flight.drag(0.1, 0.0);
        assert!((flight.forward().angle_between(before) - 0.1 * TURN).abs() < 1e-9);
        flight.drag(0.0, 0.05);
        let level = flight.forward().dot(DVec3::NEG_Y).asin();
        assert!((level.abs() - 0.05 * TURN).abs() < 1e-9, "{level}");
        // The initial distance is 4 units.
        let mut orbit = self::flight();
        orbit.wheel(-1e3);
        assert!((orbit.camera().eye().length() / (4.0 * REACH[1]) - 1.0).abs() < 1e-9);
        orbit.wheel(1e4);
        assert!((orbit.camera().eye().length() / (4.0 * REACH[0]) - 1.0).abs() < 1e-6);
        for (notches, reach) in [(1e4, REACH[1]), (-1e4, REACH[0])] {
            flight.wheel(notches);
            assert!((flight.speed / (4.0 * reach) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_drag_takes_what_is_under_the_mouse_along() {
        // A point before the pivot moves to the right and down.
        let near = DVec3::new(0.0, 0.0, -1.0);
        let mut orbit = flight();
        orbit.drag(0.05, 0.05);
        let (x, y, _) = orbit.camera().project(near);
        assert!(x > 32.5 && y > 24.5, "{x} {y}");
        // In flight the view turns there, and the scene moves the other way.
        let mut fly = flight();
        fly.motion = Motion::Fly;
        fly.drag(0.05, 0.05);
        let (x, y, _) = fly.camera().project(near);
        assert!(x < 31.5 && y < 23.5 && (fly.camera().eye() - DVec3::new(0.0, 0.0, -4.0)).length() < 1e-12, "{x} {y}");
        let mut pan = flight();
        pan.pan(5.0, -3.0);
        let (x, y, _) = pan.camera().project(DVec3::ZERO);
        assert!((x - 37.0).abs() < 1e-9 && (y - 21.0).abs() < 1e-9);
    }

    #[test]
    fn keys_go_where_the_view_goes_and_walking_stays_on_the_ground() {
        let mut flight = flight();
        flight.motion = Motion::Fly;
        flight.go([0.0, 0.0, 1.0], 1.0);
        assert!((flight.camera().eye() - DVec3::new(0.0, 0.0, -2.0)).length() < 1e-12);
        flight.drag(0.0, 0.2);
        let eye = flight.camera().eye();
        let mut walk = flight.clone();
        walk.motion = Motion::Walk;
        for (flight, level) in [(&mut flight, false), (&mut walk, true)] {
            flight.go([1.0, 0.0, 1.0], 0.5);
            assert_eq!((flight.camera().eye().y - eye.y).abs() < 1e-12, level);
            assert!((flight.camera().eye() - eye).length() > 0.5);
        }
    }

    #[test]
    fn the_wheel_goes_nearer_in_an_orbit_and_faster_in_flight() {
        let mut flight = flight();
        assert!(flight.wheel(1.0));
        assert!((flight.camera().eye().length() - 4.0 / NOTCH).abs() < 1e-12);
        flight.motion = Motion::Walk;
        let (speed, camera) = (flight.speed, *flight.camera());
        // The camera has not left the photo's pose.
        assert!(!flight.wheel(2.0));
        assert!((flight.speed - speed * NOTCH * NOTCH).abs() < 1e-12);
        assert_eq!(*flight.camera(), camera);
    }

    #[test]
    fn a_jump_keeps_the_cameras_bits_and_finds_a_point_to_go_round() {
        let mut flight = flight();
        let camera = Camera {
            rotation: DMat3::from_rotation_y(1.0),
            translation: DVec3::new(0.1, 0.2, 3.0),
            ..*flight.camera()
        };
        flight.jump(camera, DVec3::ZERO);
        assert_eq!(*flight.camera(), camera);
        // The origin lies 3 units ahead, and to the side.
        assert!((flight.distance - 3.0).abs() < 1e-12);
        flight.jump(camera, camera.eye());
        assert_eq!(flight.distance, 1.0);
    }
}
