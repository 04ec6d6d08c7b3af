// Union-find over the points of one set. The larger root is hooked under the smaller one, so a component's
// root is its smallest member in any schedule of lanes. Labels only decrease, each to an ancestor, so a stale
// one is still an ancestor.
//
// Lanes read labels while others write them, so every access is atomic. Nothing else is ordered by them,
// hence relaxed.
// The including kernel declares `labels`.

uint label_at(uint i) {
    return atomicLoad(labels[i], gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed);
}

// The root of x, halving the path.
uint find(uint first, uint x) {
    while (true) {
        uint parent = label_at(first + x);
        if (parent == x) return x;
        uint grandparent = label_at(first + parent);
        if (grandparent == parent) return parent;
        atomicMin(labels[first + x], grandparent);
        x = grandparent;
    }
    return x;
}

// Joins the components of a and b and returns their common root as known here. A failed exchange means that
// another lane made progress, and no lane waits for another.
uint unite(uint first, uint a, uint b) {
    while (true) {
        a = find(first, a);
        b = find(first, b);
        if (a == b) return a;
        uint low = min(a, b), high = max(a, b);
        if (atomicCompSwap(labels[first + high], high, low) == high) return low;
    }
    return a;
}
