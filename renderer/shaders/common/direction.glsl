// direction: the view direction delta that the colour network and spherical harmonics see.
// Reads:   nothing.
// Defines: vec3 direction_from(vec3 eye, vec3 point): unit length, away from the eye (paper eq. 4);
//          zero where the two coincide.
// Units:   metres, one frame for both.

vec3 direction_from(vec3 eye, vec3 point) {
    vec3 ray = point - eye;
    float largest = max(abs(ray.x), max(abs(ray.y), abs(ray.z)));
    if (!(largest > 0.0)) return vec3(0.0);
    ray /= largest;  // squares of very short rays would be 0
    return ray / length(ray);
}
