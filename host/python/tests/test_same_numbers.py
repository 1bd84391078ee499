"""Whoever moves from the binary to Python gets the same files to the last digit; of a diagnosis, verdict, names and estimates are compared."""

import json
import unittest

import numpy as np

import flexcal
from support import calibrated, doggy, host, same, scratch


class SameNumbers(unittest.TestCase):
    def test_calibrate_verify_observe_and_check(self):
        run, cal = doggy(), calibrated()
        host("calibrate", "doggy.mcap", "-o", "cal.json", cwd=scratch())
        same(self, cal, scratch() / "cal.json")
        cal.save("ours.json")
        self.assertEqual((scratch() / "ours.json").read_text(), cal.to_json())

        theirs = flexcal.load_calibration("cal.json")
        host("verify", "cal.json", "doggy.mcap", "-o", "verification.json", cwd=scratch())
        same(self, flexcal.verify(theirs, run), scratch() / "verification.json")
        host("observe", "cal.json", "doggy.mcap", "-o", "observation.json", "--estimates", "e.csv", cwd=scratch(), codes=(0, 4))
        observed = flexcal.observe(theirs, run)
        same(self, observed, scratch() / "observation.json")
        table = np.genfromtxt(scratch() / "e.csv", delimiter=",", names=True)
        np.testing.assert_array_equal(observed.states[:, 0], table[observed.names[0]])
        host("check", "doggy.mcap", "-o", "check.json", cwd=scratch())
        same(self, flexcal.check(run), scratch() / "check.json")

    def test_an_extended_model_and_fixed_noise(self):
        doggy()  # is where the scratch folder is
        flexcal.simulate("doggy", seed=3, effects=["voltage_sag"]).save("sag.mcap")
        extended = flexcal.calibrate("sag.mcap", extend=["voltage_sag"], noise="fixed")
        host("calibrate", "sag.mcap", "--extend", "voltage_sag", "--noise", "fixed", "-o", "ext.json", cwd=scratch())
        same(self, extended, scratch() / "ext.json")

    def test_diagnose(self):
        doggy()  # is where the scratch folder is
        for nth in (1, 2):
            hidden = flexcal.simulate("one_joint", motion="validation", seed=6, effects=["cogging"], nth=nth)
            hidden.save(f"cogging{nth}.mcap")
        # Two candidates of the catalogue are enough to compare.
        catalogue = [effect["id"] for effect in json.loads(host("effects", "--json", cwd=scratch()))]
        without = [effect for effect in catalogue if effect not in ("cogging", "voltage_sag")]
        found = flexcal.diagnose("cogging1.mcap", holdout="cogging2.mcap", without=without)
        options = [word for effect in without for word in ("--without", effect)]
        arguments = ("cogging1.mcap", "--holdout", "cogging2.mcap", *options, "-o", "diagnosis.json")
        host("diagnose", *arguments, cwd=scratch(), codes=(0, 10, 11, 12))
        theirs = json.loads((scratch() / "diagnosis.json").read_text())
        self.assertEqual(found.verdict, theirs["verdict"])
        self.assertEqual(found.named, [finding["effect"] for finding in theirs["findings"]])
        extended = [parameter["estimate"] for parameter in theirs["extended"]["parameters"]]
        # Searches end where the cost changes by 1e-9 of itself.
        np.testing.assert_allclose(found.extended.estimates, extended, rtol=1e-6, atol=1e-9)

    def test_a_table_and_its_arrays(self):
        run = doggy()
        host("export", "doggy.mcap", "--csv", "doggy.csv", cwd=scratch())
        host("import", "doggy.csv", "-o", "imported.mcap", cwd=scratch())
        columns = {name: run[name] for name in run.columns if not name.startswith("u")}
        table = np.genfromtxt(scratch() / "doggy.csv", delimiter=",", names=True)
        arrays = flexcal.from_arrays("doggy", t_s=1e-6 * table["t_us"], u=run.u, name="doggy.csv", **columns)
        grouped = flexcal.from_arrays(
            "doggy",
            t_s=1e-6 * table["t_us"],
            u=run.u,
            theta=np.stack([run[f"theta{i}"] for i in (1, 2, 3)], axis=1),
            g1=np.stack([run[f"g1{axis}"] for axis in "xyz"], axis=1),
            g2=np.stack([run[f"g2{axis}"] for axis in "xyz"], axis=1),
        )
        imported = flexcal.load("imported.mcap")
        loaded = flexcal.load("doggy.csv", robot="doggy")
        for other in (arrays, grouped, loaded):
            np.testing.assert_array_equal(other.t_s, imported.t_s)
            for name in run.columns:
                np.testing.assert_array_equal(other[name], imported[name])
        self.assertEqual(loaded.sha256, imported.sha256)
        of_arrays = flexcal.calibrate(arrays).to_dict()
        host("calibrate", "imported.mcap", "-o", "of_table.json", cwd=scratch())
        of_table = json.loads((scratch() / "of_table.json").read_text())
        self.assertEqual(of_arrays["parameters"], of_table["parameters"])

    def test_arrays_frames_and_pages_say_what_the_result_says(self):
        cal = calibrated()
        result = cal.to_dict()
        self.assertEqual(cal.estimates.tolist(), [p["estimate"] for p in result["parameters"]])
        self.assertEqual(cal.covariance.tolist(), result["covariance"]["matrix"])
        shown = [i for i, name in enumerate(cal.names) if name in cal.covariance_names]
        # Errors are at least those of the covariance; rtol 1e-9 is rounding.
        self.assertTrue(np.all(cal.std_errors[shown] >= np.sqrt(np.diag(cal.covariance)) * (1 - 1e-9)))
        frame = cal.parameters
        self.assertEqual(frame.loc["k_s[2]", "estimate"], cal["k_s[2]"])
        self.assertEqual(frame.index.tolist(), cal.names)
        page = cal._repr_html_()
        self.assertTrue(page.startswith("<iframe") and "k_s[2]" in page)
        self.assertTrue(cal.page().startswith("<!DOCTYPE html>"))
        verified = flexcal.verify(cal, doggy())
        self.assertEqual(verified.predicted.shape, (len(doggy()), len(doggy().robot.channels)))


if __name__ == "__main__":
    unittest.main()
