"""Where the lattice lies on the unrolled domain (paper, definition 2).

A domain is glued by motions g_i: z ↦ ρ_i·z + t_i. The lattice is laid on it by a map W of the vertices under
which each of them becomes a symmetry p ↦ ρ_i·p + τ_i of the tiling. Under a similarity W = A·z + B it becomes
p ↦ ρ_i·p + (A·t_i + (1 − ρ_i)·B). So a placement is A, B and integers τ_i, and what is left to be deformed is
A·t_i + (1 − ρ_i)·B − τ_i. It is found in stages:

1. *Target* (``target``, ``size``): the A that is asked for, by a size and a direction, and the phase.
2. *Candidates*: the A and τ_i near to it. This alone differs from domain to domain:

   - nets (``net``): sizes, and all τ_i jointly (``joint``), so that the energy of the deformation is least;
   - sheets with one generator (``sheet``): the same, but solved: where g turns, B makes up for any τ; else
     the nearest τ is the best, and A = τ/t where that is near to the target;
   - cylinders (``cylinder``): the size asked for counts cells along g, so that A = τ/t always, and τ is one
     of the translations with about as many;
   - straight sides and features (``align``, ``strain``, ``features``; on nets ``polygons``): also the lattice
     line that each of them moves to, which enters the same energy.
3. *Origin*: B as the motions that turn want it; where none does, as lines do, or the phase at the anchor.
4. *Deformation* (``deform``): what is left, and the lines, by least squares, the motions being exact.

``choose`` takes the candidates that suit a domain and what is to be aligned. All end in a ``Placement``.
"""
