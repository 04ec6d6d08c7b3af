// Cameras: rotation from world to camera by rows, x to the right, y down, looking along z, as everywhere in
// glint.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const sum = (a, b, times) => [a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]];
const unit = (v) => {
    const length = Math.hypot(...v);
    return length > 0 ? v.map((c) => c / length) : [0, -1, 0];
};

/** Rotates `v` by `angle` around the unit vector `axis` (Rodrigues). */
function turned(v, axis, angle) {
    const c = Math.cos(angle), s = Math.sin(angle), along = (1 - c) * dot(axis, v);
    const [x, y, z] = axis;
    const across = [y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]];
    return v.map((component, i) => c * component + s * across[i] + along * axis[i]);
}

/**
 * Range of x/z and y/z to which the Jacobian is clamped: `limit` times half the image of `view` around its
 * middle.
 */
function slopes({ width, height, fx, fy, cx, cy }, limit) {
    const middle = [(width / 2 - cx) / fx, (height / 2 - cy) / fy];
    const reach = [(limit * width) / (2 * fx), (limit * height) / (2 * fy)];
    return { low: middle.map((at, i) => at - reach[i]), high: middle.map((at, i) => at + reach[i]) };
}

/** Camera that starts at `shot` of the scene's description and orbits `pivot`; `up` remains the upward direction. */
class Camera {
    constructor(shot, pivot, up) {
        this.shot = shot;
        const r = shot.rotation, t = shot.translation;
        this.rows = [r.slice(0, 3), r.slice(3, 6), r.slice(6, 9)];
        this.eye = [0, 1, 2].map((i) => -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]));
        this.up = up;
        const depth = dot(this.rows[2], sum(pivot, this.eye, -1));
        // A pivot behind the camera is not orbited.
        const away = Math.hypot(...sum(pivot, this.eye, -1)) || 1;
        this.pivot = depth > 0.1 * away ? pivot : sum(this.eye, this.rows[2], away);
    }

    /** View for an image of this size, with the whole image of the shot in its middle. */
    view(width, height) {
        const { shot, rows, eye } = this;
        const scale = Math.min(width / shot.width, height / shot.height);
        const row = (r) => [...r, -dot(r, eye)];
        return {
            width, height, eye,
            rowX: row(rows[0]), rowY: row(rows[1]), rowZ: row(rows[2]),
            fx: shot.fx * scale, fy: shot.fy * scale,
            cx: shot.cx * scale + (width - shot.width * scale) / 2,
            cy: shot.cy * scale + (height - shot.height * scale) / 2,
        };
    }

    /** Orbits by radians around the upward axis and around the camera's x axis. */
    orbit(yaw, pitch) {
        // Stops before the poles, where left and right would swap.
        const height = Math.asin(Math.max(-1, Math.min(1, dot(this.rows[2], this.up))));
        const most = 1.5;
        pitch = Math.max(Math.min(pitch, Math.max(most - height, 0)), Math.min(-most - height, 0));
        const turn = (v) => turned(turned(v, this.rows[0], pitch), this.up, yaw);
        const away = turn(sum(this.eye, this.pivot, -1));
        this.rows = this.rows.map(turn);
        this.eye = sum(this.pivot, away, 1);
    }

    /** Moves by pixels of an image of this size. Points as deep as the pivot follow the pointer. */
    pan(dx, dy, width, height) {
        const { fx, fy } = this.view(width, height);
        const depth = Math.hypot(...sum(this.pivot, this.eye, -1));
        const by = sum(this.rows[0].map((c) => (-dx * depth * c) / fx), this.rows[1], (-dy * depth) / fy);
        this.eye = sum(this.eye, by, 1);
        this.pivot = sum(this.pivot, by, 1);
    }

    /** Multiplies the distance to the pivot by `times`. */
    zoom(times) {
        this.eye = sum(this.pivot, sum(this.eye, this.pivot, -1), times);
    }
}

/** Upward direction: opposite to the mean of the cameras' y axes. */
function upOf(shots) {
    return unit(shots.reduce((mean, { rotation }) => sum(mean, rotation.slice(3, 6), -1), [0, 0, 0]));
}
