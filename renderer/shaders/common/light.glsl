// light: what one channel of an anchor's light by direction gives.
// Reads:   nothing.
// Defines: float light_along(vec4 low, vec4 high, vec3 d): coefficients of the spherical harmonics
//          of degree 1 and 2, in units of those of degree 1, along d: light_harmonics.py.
// Units:   d is a unit vector from the eye, or zero; light has none.

float light_along(vec4 low, vec4 high, vec3 d) {
    vec3 products = 2.2360680 * d * d.yzx, squares = d * d;
    float zone = 0.6454972 * (2.0 * squares.z - squares.x - squares.y);
    float rest = 1.1180340 * (squares.x - squares.y);
    return dot(low, vec4(d, products.x)) + dot(high, vec4(products.yz, zone, rest));
}
