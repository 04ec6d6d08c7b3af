// Arguments of an optimiser step: learning rates by parameter, the bias corrections 1/(1 - 0.9^t) and 1/(1 -
// 0.999^t) (or 1 and 1), and the step. Newton's step also takes its part of the way to the minimum.
struct StepRates {
    float mean, log_scale, quat, opacity, dc, sh, direction, width, sharpness;
    float first_correction, second_correction;
    float lobe_first_correction, lobe_second_correction;
    uint step;  // counted from 0 since the moments were reset
    float newton;
    uint probe; // not 0: gradients are those of loss_probe, and only curvatures change
};
