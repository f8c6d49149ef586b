"""An instance of an FMU by FMPy, with variables by name."""

from __future__ import annotations

from pathlib import Path


class Slave:
    """An initialised instance of a co-simulation FMU."""

    def __init__(self, path: Path, folder: Path, parameters: dict[str, float]) -> None:
        import fmpy
        from fmpy import fmi2, fmi3

        fmpy.extract(str(path), str(folder))
        about = fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in about.modelVariables}
        self.version = int(about.fmiVersion[0])
        kind = fmi2.FMU2Slave if self.version == 2 else fmi3.FMU3Slave
        self.unit = kind(
            guid=about.instantiationToken,
            modelIdentifier=about.coSimulation.modelIdentifier,
            unzipDirectory=str(folder),
            instanceName=path.stem,
        )
        self.unit.instantiate()
        self.set(list(parameters), list(parameters.values()))
        if self.version == 2:
            self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def set(self, names, values):
        """Set real variables."""
        put = self.unit.setReal if self.version == 2 else self.unit.setFloat64
        put([self.references[n] for n in names], list(values))

    def get(self, names):
        """Return values of real variables."""
        take = self.unit.getReal if self.version == 2 else self.unit.getFloat64
        return take([self.references[n] for n in names])

    def step(self, time, size):
        """Perform a step."""
        self.unit.doStep(currentCommunicationPoint=time, communicationStepSize=size)


def slave(path, folder, parameters):
    """Return an initialised instance with values of parameters."""
    return Slave(path, folder, parameters)
