// Limits of the search for bands: of the colors that views ask of a Gaussian, and of the fit to them.
const float LEAST_WEIGHT = 1e-3;  // blend weights of a view, summed over its pixels
const float MOST_COLOR = 1e3;     // of a channel
const float RIDGE = 0.0016;       // of the coefficients of bands, relative to the weights of all views
const float MOST_LEVERAGE = 0.99; // a view of more has no others to be told by, and gains nothing
