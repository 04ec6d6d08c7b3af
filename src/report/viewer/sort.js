// Orders Gaussians back to front. Runs in a worker, whose source is this function's text; where no worker can be had, in the page.

/**
 * `positions`: x, y, z of each Gaussian. What comes back sorts Gaussians `first` to `last` (exclusive) by camera z into `order` and
 * says how many are beyond the near plane; the others are left out. `row` is the camera's third row, `near` behind it.
 *
 * Two passes of a counting sort over the 32 bits of z as float32, which for positive numbers are in the order of the numbers. So the
 * order is that of the renderer, exactly: front to back by z, ties by index, read from its end.
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
        // From the last index to the first, and the far ones first: reversed order, so of equal depths the last comes first.
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

/** What the worker does: the first message brings the positions, each other one an order to be filled. */
function sortInWorker() {
    let sort = null;
    const back = { order: null, count: 0, time: 0 }, transfer = [null];
    onmessage = ({ data }) => {
        if (!sort) {
            sort = makeSorter(data);
            return;
        }
        const begin = performance.now();
        back.count = sort(data.row, data.first, data.last, new Uint32Array(data.order));
        back.time = performance.now() - begin;
        back.order = transfer[0] = data.order;
        postMessage(back, transfer);
    };
}

/** Sorts beside the page. `done(order, count, time)` is called for each request; one is under way at a time. */
class Order {
    constructor(positions, done) {
        const count = positions.length / 3;
        this.done = done;
        this.busy = false;
        this.packet = { row: new Float64Array(5), first: 0, last: 0, order: new ArrayBuffer(4 * count) };
        this.transfer = [null];
        try {
            const source = `${makeSorter}\n(${sortInWorker})();`;
            const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
            this.worker = new Worker(address);
            this.worker.onmessage = ({ data }) => this.finish(data.order, data.count, data.time);
            this.worker.postMessage(positions, [positions.buffer]);
        } catch {
            this.worker = null;
            this.sort = makeSorter(positions);
        }
    }

    /** Of the row of camera z and the near plane; false where the last request is not done. */
    request(row, near, first, last) {
        if (this.busy) return false;
        this.busy = true;
        const packet = this.packet;
        packet.row.set(row);
        packet.row[4] = near;
        packet.first = first;
        packet.last = last;
        if (this.worker) {
            this.transfer[0] = packet.order;
            this.worker.postMessage(packet, this.transfer);
        } else {
            const begin = performance.now();
            const count = this.sort(packet.row, first, last, new Uint32Array(packet.order));
            this.finish(packet.order, count, performance.now() - begin);
        }
        return true;
    }

    finish(order, count, time) {
        this.packet.order = order;
        this.busy = false;
        this.done(new Uint32Array(order, 0, count), count, time);
    }
}
