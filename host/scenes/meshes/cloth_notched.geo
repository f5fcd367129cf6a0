// A cloth of 0.20 m x 0.12 m in the xy-plane, centred at the origin, with a rounded notch in each long
// edge: two places, not facing each other, where a tear may start.
//
// The mesh beside this file was made by Gmsh 4.8.4 with
//
//   gmsh -2 cloth_notched.geo -format msh41 -o cloth_notched.msh
//
// Lengths are in metres. Each half notch is an arc of `arc_cells` equal chords, so the area of the mesh
// is known exactly: L*W - 2*(2*r*straight + arc_cells*r^2*sin(Pi/(2*arc_cells))).

L = 0.20;          // length, along x
W = 0.12;          // width, along y
r = 0.004;         // radius of a notch's end
straight = 0.016;  // straight part of a notch; it reaches straight + r into the cloth
x_bottom = -0.015; // where the notches are
x_top = 0.022;
arc_cells = 2;     // chords per quarter circle

coarse = 0.0100;   // element size away from the notches
fine = 0.0060;     // element size at their ends

// Outline, counter-clockwise from the lower left corner.
Point(1) = {-L/2, -W/2, 0, coarse};
Point(2) = {x_bottom - r, -W/2, 0, coarse};
Point(3) = {x_bottom - r, -W/2 + straight, 0, fine};
Point(4) = {x_bottom, -W/2 + straight, 0, fine}; // centre of the arcs, no part of the cloth
Point(5) = {x_bottom, -W/2 + straight + r, 0, fine};
Point(6) = {x_bottom + r, -W/2 + straight, 0, fine};
Point(7) = {x_bottom + r, -W/2, 0, coarse};
Point(8) = {L/2, -W/2, 0, coarse};
Point(9) = {L/2, W/2, 0, coarse};
Point(10) = {x_top + r, W/2, 0, coarse};
Point(11) = {x_top + r, W/2 - straight, 0, fine};
Point(12) = {x_top, W/2 - straight, 0, fine}; // centre of the arcs, no part of the cloth
Point(13) = {x_top, W/2 - straight - r, 0, fine};
Point(14) = {x_top - r, W/2 - straight, 0, fine};
Point(15) = {x_top - r, W/2, 0, coarse};
Point(16) = {-L/2, W/2, 0, coarse};

Line(1) = {1, 2};
Line(2) = {2, 3};
Circle(3) = {3, 4, 5};
Circle(4) = {5, 4, 6};
Line(5) = {6, 7};
Line(6) = {7, 8};
Line(7) = {8, 9};
Line(8) = {9, 10};
Line(9) = {10, 11};
Circle(10) = {11, 12, 13};
Circle(11) = {13, 12, 14};
Line(12) = {14, 15};
Line(13) = {15, 16};
Line(14) = {16, 1};

Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14};
Plane Surface(1) = {1};

Transfinite Curve {3, 4, 10, 11} = arc_cells + 1;

Physical Curve("left") = {14};
Physical Curve("right") = {7};
Physical Surface("cloth") = {1};

Mesh.Algorithm = 6; // frontal Delaunay
Mesh.ElementOrder = 1;
Mesh.RandomSeed = 1;
