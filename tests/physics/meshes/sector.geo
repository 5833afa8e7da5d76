// The paper's shoe, in mm: an annular sector.
SetFactory("Built-in");
a = -65 * Pi / 180;
Point(1) = {80 * Cos(a), 80 * Sin(a), -18.25}; Point(2) = {100 * Cos(a), 100 * Sin(a), -18.25};
Point(3) = {100 * Cos(a), 100 * Sin(a), 18.25}; Point(4) = {80 * Cos(a), 80 * Sin(a), 18.25};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Transfinite Curve{1, 3} = 3; Transfinite Curve{2, 4} = 5; Transfinite Surface{1}; Recombine Surface{1};
out[] = Extrude {{0, 0, 1}, {0, 0, 0}, 130 * Pi / 180} { Surface{1}; Layers{20}; Recombine; };
Physical Volume("SHOE") = {out[1]};
Physical Surface("LINING") = {out[3]};
