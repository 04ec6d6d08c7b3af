// Density control: how Gaussians are pruned and multiplied while they train (docs/method.md, section 2). Needs common.glsl.

// Words of `words`.
const uint OLD = 0;        // Gaussians before
const uint ALIVE = 1;      // those that stay
const uint CANDIDATES = 2; // those that may be drawn; with replacement the sum of their weights
const uint CHILDREN = 3;   // that are drawn
const uint NEW = 4;        // Gaussians after
const uint WORDS = 5;

// Components of `scores`, a quad for each place: sums over the views that were looked at since the last refinement.
const uint ERROR = 0;     // of blend weight times error of the pixel
const uint WEIGHT = 1;    // of blend weight
const uint PULL = 2;      // of the length of the mean's gradient in the image, in halves of its sides
const uint SEEN = 3;      // views that blend the Gaussian
const uint SCORES = 4;    // components

// Strategies.
const uint MCMC = 0;
const uint ADC = 1;
const uint BUDGET = 2;

// What a hash is for, so that no two uses share a number.
const uint HASH_KEY = 0;
const uint HASH_DRAW = 1;
const uint HASH_SPLIT = 2;
const uint HASH_NOISE = 3;
