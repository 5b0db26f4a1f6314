// activation: what a network's last layer goes through, by kind (networks.ACTIVATIONS).
// Reads:   nothing.
// Defines: float activate(uint kind, float z); kinds: none, tanh, sigmoid, softplus, exp.
// Units:   none; a head's gain gives metres or display values.

float activate(uint kind, float z) {
    switch (kind) {
    case 1u: return tanh(clamp(z, -15.0, 15.0));  // +-1 beyond; some drivers' tanh(90) is NaN
    case 2u: return 1.0 / (1.0 + exp(-z));
    case 3u: return max(z, 0.0) + log(1.0 + exp(-abs(z)));  // never exp of a large number
    case 4u: return exp(z);
    }
    return z;
}
