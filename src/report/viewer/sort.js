// Sorts Gaussians back to front, in a worker whose source is this function's text; without workers, in the
// page.

/**
 * `positions`: x, y, z of each Gaussian. The returned function sorts Gaussians `first` to `last`
 * (exclusive) by camera z into `order` and returns the number of those beyond the near plane; others are
 * left out. `row` is the camera's third row, followed by the near plane.
 *
 * Two passes of a counting sort over the 32 bits of z as float32. For positive numbers, these have the
 * order of the numbers. The result is exactly the renderer's order, front to back by z with ties by index,
 * but reversed.
 */
function makeSorter(positions) {
    const most = positions.length / 3;
    const depths = new Float32Array(most), bits = new Uint32Array(depths.buffer), ids = new Uint32Array(most);
    const sortedBits = new Uint32Array(most), sortedIds = new Uint32Array(most);
    const low = new Uint32Array(65536), high = new Uint32Array(65536);
    return function sort(row, first, last, order) {
        const [x, y, z, w, near] = row;
        low.fill(0);
        high.fill(0);
        let count = 0;
        // From the last index to the first, and by inverted depth: the order is reversed, so of equal
        // depths the last comes first.
        for (let i = last - 1; i >= first; --i) {
            const depth = x * positions[3 * i] + y * positions[3 * i + 1] + z * positions[3 * i + 2] + w;
            if (!(depth > near)) continue;
            depths[count] = depth;
            const key = ~bits[count] >>> 0;
            bits[count] = key;
            ids[count++] = i;
            ++low[key & 65535];
            ++high[key >>> 16];
        }
        for (let digit = 0, a = 0, b = 0; digit < 65536; ++digit) {
            const inLow = low[digit], inHigh = high[digit];
            low[digit] = a;
            high[digit] = b;
            a += inLow;
            b += inHigh;
        }
        for (let i = 0; i < count; ++i) {
            const to = low[bits[i] & 65535]++;
            sortedBits[to] = bits[i];
            sortedIds[to] = ids[i];
        }
        for (let i = 0; i < count; ++i) order[high[sortedBits[i] >>> 16]++] = sortedIds[i];
        return count;
    };
}

/** Code of the worker: the first message brings the positions, each later one an order to fill. */
function sortInWorker() {
    let sort = null;
    onmessage = ({ data }) => {
        if (!sort) {
            sort = makeSorter(data);
            return;
        }
        const begin = performance.now();
        const count = sort(data.row, data.first, data.last, new Uint32Array(data.order));
        postMessage({ order: data.order, count, time: performance.now() - begin }, [data.order]);
    };
}

/**
 * Sorts in the background, in a worker if possible. `done(order, time)` is called for each request; only
 * one runs at a time.
 */
class Order {
    /** `positions()` computes the positions again. */
    constructor(positions, done) {
        const own = positions();
        this.done = done;
        this.busy = false;
        this.buffer = new ArrayBuffer((4 * own.length) / 3);
        this.worker = null;
        try {
            const source = `${makeSorter}\n(${sortInWorker})();`;
            this.worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
            this.worker.onmessage = ({ data }) => this.finish(data.order, data.count, data.time);
            this.worker.onerror = () => this.alone(positions());
            this.worker.postMessage(own, [own.buffer]);
        } catch {
            this.alone(positions());
        }
    }

    /** Continues in the page, without the worker. */
    alone(positions) {
        this.worker = null;
        this.sort = makeSorter(positions);
        if (this.busy) {
            this.buffer = new ArrayBuffer((4 * positions.length) / 3);
            this.run(this.last);
        }
    }

    /**
     * Requests an order for the row of camera z and the near plane. Returns false if the last request is
     * still running.
     */
    request(row, near, first, last) {
        if (this.busy) return false;
        this.busy = true;
        this.last = { row: [...row, near], first, last };
        if (this.worker) this.worker.postMessage({ ...this.last, order: this.buffer }, [this.buffer]);
        else this.run(this.last);
        return true;
    }

    run({ row, first, last }) {
        const begin = performance.now();
        const count = this.sort(row, first, last, new Uint32Array(this.buffer));
        this.finish(this.buffer, count, performance.now() - begin);
    }

    finish(buffer, count, time) {
        this.buffer = buffer;
        this.busy = false;
        this.done(new Uint32Array(buffer, 0, count), time);
    }
}
