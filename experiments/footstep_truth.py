"""Truth of a footstep's gradients: the walker's own, beside that of the ball.

Writes footstep_truth.png. Ours differentiates the time and the end of one footstep with respect to
its start, stiffness, damping and friction. The truth is by collocation on one smooth piece of the
laws at a time (`reference/footstep.py`), which shares nothing with ours. Beside it are plain
diffrax, equal steps, CasADi's CVODES where it is installed, and differences of SciPy's solves.
"""

from _experiment import Options, by, experiment
from _footstep_peers import PEERS
from _footstep_ways import INPUTS, OUTPUTS, ours, references
from _gradient_ways import Way, draw_way, row_of, versions
from _pictures import label
from reference.footstep import LAWS, PARAMETERS, footstep
from reference.footstep import MID_STANCE as START
from tqdm import tqdm

from jaxbiped.plot.style import new_figure

OURS = Way("jaxbiped", "rtol", (1e-4, 3e-7, 1e-9), ours)


@experiment
def main(options: Options):
    truth, change, apart = references()
    ways = options.sized((OURS, *PEERS), (OURS, PEERS[-1]._replace(settings=(1e-4,))))
    work = [(way, value) for way in ways for value in way.settings]
    rows = [
        row_of("footstep", way, value, truth, truth, repeats=1, least=1e-2)
        for way, value in tqdm(work, desc="ways")
    ]
    problem = {
        "start": START.tolist(),
        "parameters": dict(zip(PARAMETERS, LAWS.tolist(), strict=True)),
        "outputs": list(OUTPUTS),
        "inputs": list(INPUTS),
        "values": truth.state.tolist(),
        "gradient": truth.gradient.tolist(),
        "switches": [list(each) for each in footstep().switches],
        "coarser_collocation": change,
        "our_finest": apart,
    }
    picture = _draw(options, [row for row in rows if row["outcome"] == "answered"])
    return {"problem": problem, "rows": rows, "versions": versions(), "picture": picture}


def _draw(options, rows):
    figure = new_figure(6.5, 5.4)
    ax = figure.subplots()
    for name, own in by("way", rows).items():
        draw_way(ax, name, own)
    ax.axhline(1.0, color="black", linewidth=0.8)
    label(ax, "relative error of the footstep [1]", "relative error of its gradient [1]")
    ax.legend(fontsize="small")
    return options.save(figure, "footstep_truth.png")


if __name__ == "__main__":
    main()
