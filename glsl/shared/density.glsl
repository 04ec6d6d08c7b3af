// Words, scores and strategies of density control, which prunes and multiplies Gaussians during training
// (docs/method.md, section 2). Needs common.glsl.

// Words of `words`.
const uint OLD = 0;        // Gaussians before the refinement
const uint ALIVE = 1;      // Gaussians that stay
const uint CANDIDATES = 2; // Gaussians that may be drawn; with replacement, the sum of their weights
const uint CHILDREN = 3;   // Gaussians that are drawn
const uint NEW = 4;        // Gaussians after the refinement
const uint WORDS = 5;

// Components of `scores`, a quad for each place: sums over the views scored since the last refinement.
const uint ERROR = 0;     // sum of blend weight times the pixel's error
const uint WEIGHT = 1;    // sum of blend weight
const uint PULL = 2;      // sum of the length of the mean's gradient in the image, in halves of its sides
const uint SEEN = 3;      // number of views that blend the Gaussian
const uint SCORES = 4;    // number of components

// Terms that density_image writes; two of three components are used.
const uint ERRORS = 0;    // mean |difference| of the channels, and 1
const uint RED_GREEN = 1; // differences of red and green
const uint BLUE = 2;      // difference of blue, and 1

// Strategies.
const uint MCMC = 0;
const uint ADC = 1;
const uint BUDGET = 2;

// Purposes of a hash, so that no two uses share a number.
const uint HASH_KEY = 0;
const uint HASH_DRAW = 1;
const uint HASH_SPLIT = 2;
const uint HASH_NOISE = 3;
