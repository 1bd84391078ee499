"""What goes wrong is told by type, with the number that was wrong and what to do."""

import ast
import os
import signal
import threading
import time
import unittest
import warnings
from pathlib import Path

import numpy as np

import flexcal
from flexcal import _native, errors
from support import doggy, scratch


class Errors(unittest.TestCase):
    def told(self, kind, *words, advice=True):
        """A context that wants an exception of this kind with these words, and with advice where there is some beside the message."""
        test = self

        class Told:
            def __enter__(self):
                return self

            def __exit__(self, found, error, _):
                test.assertTrue(found is not None and issubclass(found, kind), f"{found} instead of {kind}: {error}")
                test.assertTrue(error.advice or not advice, "there is no advice")
                for word in words:
                    test.assertIn(word, str(error))
                return True

        return Told()

    def test_each_kind_has_its_exception(self):
        run = doggy()
        with self.told(errors.UsageError, "did you mean `doggy`"):
            flexcal.robot("dogy")
        with self.told(errors.DeviceError, "nowhere.mcap"):
            flexcal.load("nowhere.mcap")
        with self.told(errors.UsageError, "base_baering", "did you mean `base_bearing`", advice=False):
            flexcal.calibrate(run, extend=["base_baering"])
        with self.told(errors.UsageError, "given twice"):
            flexcal.calibrate([run, run])
        with self.told(errors.UsageError, "preset", "papers"):
            flexcal.calibrate(run, preset="papers")
        with self.told(errors.UsageError, "no recording", advice=False):
            flexcal.calibrate([])
        (scratch() / "no.json").write_text('{"robot": 3}')
        with self.told(errors.DataError, "no.json is not a calibration"):
            flexcal.load_calibration("no.json")
        with self.told(errors.UsageError, "exists already"):
            run.save("doggy.mcap")
        with self.told(errors.UsageError, "theta9"):
            run["theta9"]

    def test_arrays_that_do_not_fit(self):
        t_s = np.arange(300) * 1e-3
        u = np.zeros(300)
        with self.told(errors.DataError, "(299, 2)", "(samples, 1)"):
            flexcal.from_arrays("emps", t_s=t_s, u=np.zeros((299, 2)), theta=u)
        with self.told(errors.DataError, "u1", "299"):
            flexcal.from_arrays("emps", t_s=t_s, u=np.zeros(299), theta=u)
        with self.told(errors.DataError, "element 7", "theta1"):
            theta = u.copy()
            theta[7] = np.inf
            flexcal.from_arrays("emps", t_s=t_s, u=u, theta=theta)
        with self.told(errors.DataError, "element 3"):
            back = t_s.copy()
            back[3] = 0.0
            flexcal.from_arrays("emps", t_s=back, u=u, theta=u)
        with self.told(errors.DataError, "phi"):
            flexcal.from_arrays("emps", t_s=t_s, u=u, phi=u)

    def test_degrees_are_refused_unless_unchecked(self):
        run = doggy()
        channels = {name: run[name] for name in run.columns if not name.startswith("u")}
        channels |= {name: np.degrees(run[name]) for name in ("theta1", "theta2", "theta3")}
        wrong = flexcal.from_arrays("doggy", t_s=run.t_s, u=run.u, **channels)
        self.assertFalse(flexcal.check(wrong).usable)
        with self.told(errors.DataError, "unchecked=True"):
            flexcal.calibrate(wrong)

    def test_a_result_that_is_not_to_be_used_warns(self):
        shaken = flexcal.simulate("doggy", seed=5, effects=["base_bearing=large"])
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            cal = flexcal.calibrate(shaken)
        said = [warning for warning in told if issubclass(warning.category, flexcal.UntrustedResult)]
        self.assertEqual(len(said), 0 if cal.is_usable else 1)


class Interrupts(unittest.TestCase):
    def test_ctrl_c_ends_a_calibration(self):
        run, steps, pressed = doggy(), [], []

        def press():
            pressed.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

        def after_the_second(step):
            steps.append(step)
            if len(steps) == 2:
                threading.Thread(target=press).start()

        with self.assertRaises(KeyboardInterrupt):
            flexcal.calibrate(run, progress=after_the_second)
        # Signals are looked for every 50 ms; ten times that for a machine with much else to do.
        self.assertLess(time.monotonic() - pressed[0], 0.5)
        # The next call is not disturbed.
        self.assertTrue(flexcal.check(run).usable)

    def test_an_exception_of_the_callback_comes_through(self):
        def refuse(step):
            raise LookupError(step)

        with self.assertRaises(LookupError):
            flexcal.calibrate(doggy(), progress=refuse)

    def test_other_threads_run_meanwhile(self):
        ticks, over = [0], threading.Event()

        def count():
            while not over.is_set():
                ticks[0] += 1
                time.sleep(0.001)

        other = threading.Thread(target=count)
        other.start()
        begin = time.monotonic()
        flexcal.calibrate(doggy())
        took_s = time.monotonic() - begin
        over.set()
        other.join()
        # A held lock would give a handful of ticks.
        self.assertGreater(ticks[0], 20 * took_s)


class Stubs(unittest.TestCase):
    def test_the_stub_names_what_the_module_has(self):
        tree = ast.parse(Path(flexcal.__file__).with_name("_native.pyi").read_text())
        for node in tree.body:
            match node:
                case ast.ClassDef(name=name, body=body):
                    told = {inner.name for inner in body if isinstance(inner, ast.FunctionDef)}
                    found = {inner for inner in dir(getattr(_native, name)) if not inner.startswith("_")}
                    self.assertEqual(told, found, name)
        told = {node.name for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(told, {name for name in dir(_native) if not name.startswith("_")})
        self.assertTrue(Path(flexcal.__file__).with_name("py.typed").exists())


if __name__ == "__main__":
    unittest.main()
