#version 450
// A quad whose corners come from the host, in clip space.
layout(push_constant) uniform Push { vec4 corners[4]; vec4 color; } push;
void main() {
    const uint order[6] = uint[](0, 1, 2, 2, 1, 3);
    gl_Position = push.corners[order[gl_VertexIndex]];
}
